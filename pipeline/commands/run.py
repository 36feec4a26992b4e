"""gsac run CLIP"""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.cache.store import Store
from gsac.pipeline.commands.options import add_json, add_params, open_store
from gsac.pipeline.errors import StageFailedError
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.report.refresh import Early, refresh_report
from gsac.pipeline.reporter import PlainReporter, reporter
from gsac.pipeline.run import Chain, Options
from gsac.pipeline.run_folder import OWN_STORE, RunFolder
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("clip", type=Path, metavar="CLIP", help="a video, or a folder of photos")
    command.add_argument("--out", type=Path, metavar="DIR", help="where results are shown (default: ./<clip>-avatar)")
    command.add_argument("--until", metavar="STAGE", help="stop after this stage")
    command.add_argument("--from", dest="start", metavar="STAGE",
                         help="what this stage needs must be in the cache already")
    command.add_argument("--force", action="append", default=[], metavar="STAGE",
                         help="run this stage again; may be repeated")
    add_params(command)
    command.add_argument("--dry-run", action="store_true", help="say what would run and why")
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    project = Project.at_hand()
    configs = resolve(project, arguments.params, arguments.set)
    clip = find_clip(arguments.clip)
    workspace = RunFolder(arguments.out or default_out(clip))
    options = Options(arguments.until, arguments.start, tuple(arguments.force))
    with reporter(plain=arguments.json) as voice:
        store = open_store(voice, None if arguments.dry_run else workspace.root / OWN_STORE)
        chain = Chain(project, configs, store, workspace, voice)
        if arguments.dry_run:
            return foretell(chain, clip, options, voice, arguments.json)
        chain.selected(options)
        workspace.prepare(clip, project, configs)
        return carry_out(chain, clip, options, voice, arguments.json)


def carry_out(chain: Chain, clip: Path, options: Options, voice: PlainReporter, json: bool) -> ExitCode:
    """The run itself; what was done is in the JSON object whether it ends well or not."""
    early = Early(chain.workspace)
    try:
        chain.run(clip, options, early.begin)
        report(chain, voice, early)
    except BaseException as error:
        error.summary = chain.summary()
        if isinstance(error, StageFailedError):
            report(chain, voice)
        raise
    if json:
        emit(chain.summary())
    voice.note(f"results: {chain.workspace.root}")
    return ExitCode.OK


def report(chain: Chain, voice: PlainReporter, early: Early | None = None) -> None:
    if (warning := refresh_report(chain.workspace, chain.results, early)) is not None:
        voice.note(f"gsac: warning: {warning}")


def foretell(chain: Chain, clip: Path, options: Options, voice: PlainReporter, json: bool) -> ExitCode:
    verdicts = chain.forecast(clip, options)
    rows = []
    for verdict in verdicts:
        outcome = Outcome.CACHED if verdict.current else Outcome.PLANNED
        info = verdict.record.info if verdict.record is not None else None
        voice.ends(verdict.stage, outcome, info.seconds if info else 0.0, f"{verdict.reason.value}: {verdict.sentence}")
        rows.append({"name": verdict.stage, "status": outcome.value, "seconds": info.seconds if info else None,
                     "key": verdict.parts.key if verdict.parts else None, "reason": verdict.reason.value})
    if json:
        emit({"stages": rows, "outputs": {}, "metrics": {}})
    return ExitCode.OK


def find_clip(path: Path) -> Path:
    """Absolute path of the clip. BadInput where there is none."""
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder; give a video or a folder of photos")
    return path.resolve()


def default_out(clip: Path) -> Path:
    return Path.cwd() / f"{clip.stem}-avatar"


def run_clip(clip: Path, out: Path, store: Store, voice: PlainReporter) -> RunFolder:
    """A whole run with the defaults."""
    project = Project.at_hand()
    configs = resolve(project)
    workspace = RunFolder(out)
    workspace.prepare(find_clip(clip), project, configs)
    carry_out(Chain(project, configs, store, workspace, voice), find_clip(clip), Options(), voice, json=False)
    return workspace
