"""gsac run [CLIP]: runs a clip through the stages; in the folder of a run its own clip, with its own parameters."""

from __future__ import annotations

import argparse
import os
import shlex
from pathlib import Path

from gsac.pipeline.asked_clip import find_clip, run_folder_here
from gsac.pipeline.clip_work import ClipWork
from gsac.pipeline.closing import closing_lines
from gsac.pipeline.commands.options import (
    add_clip,
    add_events,
    add_json,
    add_params,
    add_person,
    add_quality,
    open_journal,
    open_store,
    progress_reporter,
    values_of_person,
)
from gsac.pipeline.errors import NotUpToDateError, attach_summary
from gsac.pipeline.json_output import emit
from gsac.pipeline.other_clip import make_way
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.project import Project
from gsac.pipeline.quality import STANDARD, find_quality, name_of, quality_entry, resolve_quality
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.rows import read_json
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.run_folder import RUN, RunFolder, avatar_name
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    add_clip(command)
    command.add_argument("--out", type=Path, metavar="DIR", help="where results are shown (default: ./<clip>-avatar)")
    command.add_argument("--until", metavar="STAGE", help="stop after this stage")
    command.add_argument("--from", dest="start", metavar="STAGE",
                         help="what this stage needs must be in the cache already")
    command.add_argument("--force", action="append", default=[], metavar="STAGE",
                         help="run this stage again; may be repeated")
    command.add_argument("--replace", action="store_true", help="put this clip's avatar in place of another clip's in DIR")
    command.add_argument("--anyway", action="store_true", help="go on where nothing can come of the clip, as without a person")
    add_quality(command)
    command.set_defaults(quality=None)
    add_person(command)
    add_params(command)
    command.add_argument("--dry-run", action="store_true", help="say what would run and why, and how long it would take")
    add_json(command)
    add_events(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    project = Project.at_hand()
    here = run_folder_here() if arguments.clip is None else None
    quality, params = arguments.quality or STANDARD, arguments.params
    if here is not None:
        quality, params = own_quality(here, arguments.quality), params or here.params
    configs = resolve_quality(quality, project, params, arguments.set, values_of_person(arguments, project))
    clip = find_clip(arguments.clip)
    run_folder = RunFolder(arguments.out or (here.root if here is not None else default_out(arguments.clip or clip)))
    options = Options(arguments.until, arguments.start, tuple(arguments.force), quality, arguments.anyway)
    with progress_reporter(arguments) as reporter, open_journal(arguments, reporter) as journal:
        store = open_store(journal)
        clip_run = ClipRun(project, configs, store, run_folder, journal)
        clip_run.keys.check(clip_run.select(options))
        if arguments.dry_run:
            run_folder.refuse_foreign(clip, project)
            make_way(run_folder, clip, store, arguments.replace)
            return dry_run(clip_run, clip, options, reporter, arguments.json)
        finished = ClipWork(project, configs, store, options, journal, arguments.replace).do(clip, run_folder)
        for line in closing_lines(run_folder):
            journal.note(line)
        if arguments.json:
            emit(finished.summary())
        else:
            print(run_folder.root, flush=True)
    return ExitCode.OK


def dry_run(clip_run: ClipRun, clip: Path, options: Options, reporter: PlainReporter, json: bool) -> ExitCode:
    """Reports what would run and why, and how long it would take. Raises NotUpToDateError as the run would."""
    plans = clip_run.plan(clip, options)
    rows = []
    for plan in plans:
        outcome = Outcome.CACHED if plan.up_to_date else Outcome.PLANNED
        info = plan.record.info if plan.record is not None else None
        reporter.foresees(plan.stage, outcome, info.seconds if info else 0.0, f"{plan.reason.value}: {plan.sentence}")
        rows.append({"name": plan.stage, "status": outcome.value, "seconds": info.seconds if info else None,
                     "key": plan.parts.key if plan.parts else None, "reason": plan.reason.value})
    try:
        clip_run.foresee_refusal(plans, options)
    except NotUpToDateError as error:
        attach_summary(error, {"stages": rows})
        raise
    forecast = clip_run.foretell(clip, plans, options)
    if json:
        emit({"stages": rows, "outputs": {}, "metrics": {}, "quality": quality_entry(options.quality, clip_run.configs),
              "forecast": forecast.to_json()})
    return ExitCode.OK


def own_quality(run_folder: RunFolder, asked: str | None) -> str:
    """The preset that the run in this folder was made with. BadInput where another is asked for: the folder's params.yaml says all
    that a preset says."""
    run = read_json(run_folder.root / RUN)
    own = name_of(run.get("quality") if isinstance(run, dict) else None) or STANDARD
    if asked is not None and asked != own:
        find_quality(asked)
        command = shlex.join(["gsac", "run", str(run_folder.clip), "--out", str(run_folder.root), "--quality", asked])
        raise BadInput(f"--quality {asked}: the run in this folder has parameters of its own, of {own}; `{command}` replaces them, "
                       "--set changes one")
    return own


def default_out(clip: Path) -> Path:
    """`<clip>-avatar` here, by the name that the user gave, be it a link's. BadInput in the folder of a run, where no other one's
    may lie; it says how to have it beside that."""
    out = Path.cwd() / avatar_name(Path(os.path.abspath(clip)))
    outer = RunFolder(out).outer
    if outer is not None and not RunFolder(out).is_run:
        beside = shlex.quote(os.path.relpath(outer.parent / out.name, os.path.realpath(Path.cwd())))
        raise BadInput(f"this folder is that of a run, {outer}, and no other run's folder can lie in it; give `--out {beside}`, "
                       "too, to have it beside that one")
    return out
