"""gsac stage NAME: on the folder of a run (so DVC calls it), or on fixture artifacts (so CI does)."""

from __future__ import annotations

import argparse
import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsac.cache.errors import IntegrityError
from gsac.cache.lease import in_use
from gsac.cache.roots import OBJECT, is_object
from gsac.cache.store import Store
from gsac.pipeline.clip_end import told_clip
from gsac.pipeline.commands.options import (
    add_json,
    add_params,
    add_run_folder,
    open_journal,
    open_run_folder,
    open_store,
    progress_reporter,
)
from gsac.pipeline.errors import StageFailedError, attach_summary
from gsac.pipeline.event_file import kept_events
from gsac.pipeline.fixtures import fixture_paths
from gsac.pipeline.journal import Journal
from gsac.pipeline.json_output import emit
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.own_store import writable_store
from gsac.pipeline.params import resolve
from gsac.pipeline.plan import plan_stage
from gsac.pipeline.project import Project
from gsac.pipeline.report.refresh import refresh_report
from gsac.pipeline.rows import clip_entries, read_rows, result_row, write_rows
from gsac.pipeline.run import StageResult
from gsac.pipeline.run_folder import LOGS, OWN_STORE, REPORT, RunFolder
from gsac.pipeline.sources import Source
from gsac.pipeline.stage_runner import StageRunner
from gsac.stages.contract import BadInput, StageError


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("name", metavar="NAME", help="its name in dvc.yaml")
    add_run_folder(command)
    command.add_argument("--inputs", type=Path, metavar="DIR", help="artifacts: DIR/<input stage>/..., DIR/clip")
    command.add_argument("--out", type=Path, metavar="DIR",
                         help="gets the outputs, with --inputs; `--out DIR/NAME` feeds the next stage")
    command.add_argument("--force", action="store_true", help="run it even if its result is in the cache")
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


@dataclass(frozen=True)
class Task:
    """One stage, where its inputs lie and where its outputs are shown."""

    name: str
    keys: Keys
    store: Store
    sources: dict[str, Source]
    """Port -> input, where it lies."""
    folder: RunFolder
    """Knows what was placed in it."""
    out: Path
    """Folder for the outputs, below it or itself."""
    logs: Path
    in_run: bool = False
    """Whether `folder` is the folder of a run, whose run.json, metrics.json and report speak of the stage."""


def do(arguments: argparse.Namespace) -> ExitCode:
    if (arguments.inputs is None) != (arguments.out is None):
        raise BadInput("--inputs and --out go together; without both, the folder of a run is used")
    if arguments.inputs is not None and arguments.folder != Path("."):
        raise BadInput(f"{arguments.folder} would be the folder of a run, but --inputs and --out were given; leave one out")
    with progress_reporter(arguments) as reporter, open_journal(arguments, reporter) as journal, contextlib.ExitStack() as held:
        make_task = task_in_run_folder if arguments.inputs is None else task_on_artifacts
        task = make_task(arguments, journal, held)
        results: list[StageResult] = []
        if task.in_run:
            journal.clip = task.folder.clip_name
            held.enter_context(kept_events(task.folder, journal))
            held.enter_context(told_clip(journal, lambda: {"stages": [result.to_json() for result in results]}))
        try:
            result = run_task(task, journal, arguments.force)
        except StageFailedError as error:
            failed = StageResult(task.name, Outcome.FAILED, "", error=str(error.cause))
            attach_summary(error, {"stages": [failed.to_json()]})
            note_in_folder(task, failed, journal)
            results.append(failed)
            raise
        results.append(result)
        note_in_folder(task, result, journal)
    if arguments.json:
        outputs = task.keys.project.stage(task.name).outputs
        emit({"stages": [result.to_json()], "outputs": {f"{task.name}/{o.path}": str(task.out / o.path) for o in outputs},
              "metrics": result.metrics})
    return ExitCode.OK


def task_in_run_folder(arguments: argparse.Namespace, journal: Journal, held: contextlib.ExitStack) -> Task:
    """On the inputs that lie in the folder of a run, the one here as DVC calls it. held: until the task's end."""
    run_folder = RunFolder.around(arguments.folder)
    run_folder.say = journal.note
    held.enter_context(run_folder.hold())
    run_folder, project, configs = open_run_folder(arguments, run_folder.root, only=arguments.name)
    run_folder.say = journal.note
    store = checked_store(project, configs, arguments.name, run_folder.root, journal)
    paths = {port: run_folder.require(port) for port in project.graph.step(arguments.name).deps}
    lease_inputs(paths, held)
    sources = {port: Source(path, store) for port, path in paths.items()}
    return Task(arguments.name, Keys(project, configs, store), store, sources, run_folder, run_folder.root / arguments.name,
                run_folder.root / LOGS, in_run=True)


def task_on_artifacts(arguments: argparse.Namespace, journal: Journal, held: contextlib.ExitStack) -> Task:
    """On the artifacts of --inputs, with outputs into --out. held: until the task's end."""
    project = Project.at_hand()
    configs = resolve(project, arguments.params, arguments.set, only=arguments.name)
    lease_inputs({port: arguments.inputs / port for port in project.graph.step(arguments.name).deps}, held)
    paths = fixture_paths(project, arguments.name, arguments.inputs)
    folder = RunFolder(arguments.out)
    folder.say = journal.note
    held.enter_context(folder.hold())
    store = checked_store(project, configs, arguments.name, folder.root, journal)
    sources = {port: Source(path, store) for port, path in paths.items()}
    return Task(arguments.name, Keys(project, configs, store), store, sources, folder, folder.root, folder.root / LOGS)


def checked_store(project: Project, configs: dict[str, Any], name: str, out: Path, journal: Journal) -> Store:
    """A store for the stage's result, opened after its devices and model files are known to be there."""
    store = open_store(journal)
    Keys(project, configs, store).check([name])
    return writable_store(store, out / OWN_STORE, journal)


def lease_inputs(paths: dict[str, Path], held: contextlib.ExitStack) -> None:
    """Keeps gc from the objects, of whichever store, that the inputs are."""
    for path in paths.values():
        found = OBJECT.search(str(path.resolve()))
        if found is not None:
            held.enter_context(in_use(Store(Path(found.string[:found.start()])), [found[2]]))


def run_task(task: Task, journal: Journal, force: bool) -> StageResult:
    """Runs the stage through the store; shows its outputs as `out/<output>`."""
    store, name = task.store, task.name
    parts = task.keys.parts(name, {port: source.digest for port, source in task.sources.items()})
    with in_use(store, [parts.key]):
        plan = plan_stage(store, parts, task.keys.project.outputs(name), force, shown_key(task))
        outcome, record = Outcome.CACHED, plan.cached
        if record is None:
            require_whole(task)
            try:
                with StageRunner(task.keys, store, journal, task.logs) as runner:
                    outcome, record = runner.run(parts, plan.reason, {port: source.path for port, source in task.sources.items()},
                                                 forced=force, sources=task.sources.values())
            except StageError as error:
                journal.failed(name, parts.key, error)
                raise StageFailedError(name, error, task.logs / f"{name}.log") from error
        if outcome is Outcome.CACHED:
            journal.found(record)
        task.folder.place(store, record, task.out)
    return StageResult.of(plan, outcome, record, task.keys.configs[name])


def require_whole(task: Task) -> None:
    """IntegrityError where an input that lies in the cache is damaged."""
    for port, source in task.sources.items():
        path = source.path.resolve()
        if is_object(path) and not task.store.is_whole(path):
            raise IntegrityError(f"{port} was damaged in the cache; `gsac stage {port.partition('/')[0]}` makes it again")


def shown_key(task: Task) -> str | None:
    """Key of the result that the folder of the run shows; None outside of one."""
    row = result_row(read_rows(task.folder).get(task.name)) if task.in_run else None
    return row.get("key") if row is not None else None


def note_in_folder(task: Task, result: StageResult, journal: Journal) -> None:
    """Brings run.json, metrics.json and a report that is there up to what lies in the folder of the run."""
    if not task.in_run:
        return
    write_rows(task.folder, task.keys.project.graph, task.store, [result.to_json()], clip_entries(task.folder, task.store))
    if (task.folder.root / REPORT).exists() and (warning := refresh_report(task.folder)) is not None:
        journal.note(f"gsac: warning: {warning}")
