"""gsac stage NAME: on the folder of a run (so DVC calls it), or on fixture artifacts (so CI does)."""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.cache.digest import tree_digest
from gsac.cache.lease import in_use
from gsac.cache.store import Store
from gsac.pipeline.commands.options import add_json, add_params, open_run_folder, open_store, progress_reporter
from gsac.pipeline.errors import StageFailedError
from gsac.pipeline.graph import CLIP
from gsac.pipeline.json_output import emit
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.params import resolve
from gsac.pipeline.plan import plan_stage
from gsac.pipeline.project import Project
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.run import StageResult
from gsac.pipeline.run_folder import OWN_STORE, link
from gsac.pipeline.stage_runner import StageRunner
from gsac.stages.contract import BadInput, StageError


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("name", metavar="NAME", help="its name in dvc.yaml")
    command.add_argument("--inputs", type=Path, metavar="DIR", help="artifacts: DIR/<input stage>/..., DIR/clip")
    command.add_argument("--out", type=Path, metavar="DIR",
                         help="gets the outputs, with --inputs; `--out DIR/NAME` feeds the next stage")
    command.add_argument("--force", action="store_true", help="run it even if its result is in the cache")
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    if (arguments.inputs is None) != (arguments.out is None):
        raise BadInput("--inputs and --out go together; without both, the folder of a run is used")
    with progress_reporter(arguments) as reporter:
        if arguments.inputs is None:
            run_folder, project, configs = open_run_folder(arguments, Path.cwd(), only=arguments.name)
            store = open_store(reporter, run_folder.root / OWN_STORE)
            step = project.graph.step(arguments.name)
            digests = {port: run_folder.digest(port, store) for port in step.deps}
            paths = {port: run_folder.path(port).resolve() for port in step.deps}
            out, logs = run_folder.root / arguments.name, run_folder.root / "logs"
        else:
            project = Project.at_hand()
            store = open_store(reporter, arguments.out / OWN_STORE)
            configs = resolve(project, arguments.params, arguments.set, only=arguments.name)
            paths = fixture_paths(project, arguments.name, arguments.inputs)
            digests = {port: tree_digest(path, store.memo)[0] for port, path in paths.items()}
            out, logs = arguments.out.absolute(), arguments.out.absolute() / "logs"
        keys = Keys(project, configs, store)
        try:
            result = do_one(keys, store, reporter, arguments.name, digests, paths, out, logs, arguments.force)
        except StageFailedError as error:
            failed = StageResult(arguments.name, Outcome.FAILED, "", error=str(error.cause))
            error.summary = {"stages": [failed.to_json()]}
            raise
    if arguments.json:
        ports = {f"{arguments.name}/{o.path}": str(out / o.path) for o in project.stage(arguments.name).outputs}
        emit({"stages": [result.to_json()], "outputs": ports, "metrics": result.metrics})
    return ExitCode.OK


def do_one(keys: Keys, store: Store, reporter: PlainReporter, name: str, digests: dict[str, str], paths: dict[str, Path],
           out: Path, logs: Path, force: bool) -> StageResult:
    """One stage through the store; its outputs are shown at `out/<output>`."""
    parts = keys.parts(name, digests)
    with in_use(store, [parts.key]):
        plan = plan_stage(store, parts, force)
        outcome, record = Outcome.CACHED, plan.record
        if not plan.up_to_date:
            try:
                with StageRunner(keys, store, reporter, logs) as runner:
                    outcome, record = runner.run(plan, paths, forced=force)
            except StageError as error:
                raise StageFailedError(name, error, logs / f"{name}.log") from error
        if outcome is Outcome.CACHED:
            reporter.ends(name, outcome, record.info.seconds)
        for output in record.outputs:
            link(store.path(record, output), out / output)
    return StageResult.of(plan, outcome, record, keys.configs[name])


def fixture_paths(project: Project, name: str, folder: Path) -> dict[str, Path]:
    """Port -> path under the folder of artifacts, each checked as its own stage promises it."""
    graph = project.graph
    paths = {}
    for port in graph.step(name).deps:
        path = (folder / port).resolve()
        if not path.exists():
            raise BadInput(f"{folder / port}: missing; stage {name} reads {', '.join(graph.step(name).deps)}")
        if port != CLIP:
            maker = graph.producer[port]
            output = next(o for o in project.stage(maker).outputs if port == f"{maker}/{o.path}")
            try:
                output.check(path)
            except Exception as error:
                raise BadInput(f"{folder / port} is not what {port} promises: {error}") from error
        paths[port] = path
    return paths
