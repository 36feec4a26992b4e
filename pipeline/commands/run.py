"""gsac run CLIP: runs a clip through the stages."""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.cache.store import Store
from gsac.pipeline.closing import closing_lines
from gsac.pipeline.commands.options import (
    add_json,
    add_params,
    add_person,
    add_quality,
    open_store,
    progress_reporter,
    values_of_person,
    writable_store,
)
from gsac.pipeline.errors import StageFailedError, attach_summary, exit_code
from gsac.pipeline.json_output import emit
from gsac.pipeline.other_clip import find_other_clip, forget_results
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.project import Project
from gsac.pipeline.quality import quality_entry, resolve_quality
from gsac.pipeline.report.refresh import EarlySections, refresh_report
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.run_folder import OWN_STORE, RunFolder, avatar_name
from gsac.stages.contract import BadInput

MISTAKES = (ExitCode.USAGE, ExitCode.STALE)
"""Ends of a run that are the command line's or the clip's fault."""


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("clip", type=Path, metavar="CLIP", help="a video, or a folder of photos; masks/ beside either in a folder")
    command.add_argument("--out", type=Path, metavar="DIR", help="where results are shown (default: ./<clip>-avatar)")
    command.add_argument("--until", metavar="STAGE", help="stop after this stage")
    command.add_argument("--from", dest="start", metavar="STAGE",
                         help="what this stage needs must be in the cache already")
    command.add_argument("--force", action="append", default=[], metavar="STAGE",
                         help="run this stage again; may be repeated")
    command.add_argument("--replace", action="store_true", help="put this clip's avatar in place of another clip's in DIR")
    command.add_argument("--anyway", action="store_true", help="go on where nothing can come of the clip, as without a person")
    add_quality(command)
    add_person(command)
    add_params(command)
    command.add_argument("--dry-run", action="store_true", help="say what would run and why, and how long it would take")
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    project = Project.at_hand()
    configs = resolve_quality(arguments.quality, project, arguments.params, arguments.set, values_of_person(arguments, project))
    clip = find_clip(arguments.clip)
    run_folder = RunFolder(arguments.out or default_out(clip))
    options = Options(arguments.until, arguments.start, tuple(arguments.force), arguments.quality, arguments.anyway)
    with progress_reporter(arguments) as reporter:
        store = open_store(reporter)
        clip_run = ClipRun(project, configs, store, run_folder, reporter)
        clip_run.keys.check(clip_run.select(options))
        if arguments.dry_run:
            return dry_run(clip_run, clip, options, reporter, arguments.json)
        run_folder.say = reporter.note
        run_folder.refuse_foreign(clip, project)
        with run_folder.hold():
            other = find_other_clip(run_folder, clip, store)
            if other is not None and not arguments.replace:
                raise BadInput(f"{run_folder.root} holds the avatar of {other}; give another --out, or --replace to put this "
                               "clip's there")
            run_folder.prepare(clip, project, configs)
            if other is not None:
                forget_results(run_folder)
            own = writable_store(store, run_folder.root / OWN_STORE, reporter)
            if own is not store:
                clip_run = ClipRun(project, configs, own, run_folder, reporter)
            return carry_out(clip_run, clip, options, reporter, arguments.json)


def carry_out(clip_run: ClipRun, clip: Path, options: Options, reporter: PlainReporter, json: bool) -> ExitCode:
    """The run, its report and the last lines; stdout gets the folder, or the JSON object, which lists the stages done whether it
    ends well or not."""
    early = EarlySections(clip_run.folder)
    try:
        clip_run.pull_models(clip, options)
        clip_run.run(clip, options, early.start)
        write_report(clip_run, reporter, early)
    except BaseException as error:
        attach_summary(error, clip_run.summary())
        if exit_code(error) in MISTAKES and not clip_run.finished:
            clip_run.folder.discard()
        elif isinstance(error, StageFailedError):
            write_report(clip_run, reporter)
        raise
    for line in closing_lines(clip_run.folder):
        reporter.note(line)
    if json:
        emit(clip_run.summary())
    else:
        print(clip_run.folder.root, flush=True)
    return ExitCode.OK


def write_report(clip_run: ClipRun, reporter: PlainReporter, early: EarlySections | None = None) -> None:
    """Writes report.html if it is due; a failure is only a warning."""
    if (warning := refresh_report(clip_run.folder, early)) is not None:
        reporter.note(f"gsac: warning: {warning}")


def dry_run(clip_run: ClipRun, clip: Path, options: Options, reporter: PlainReporter, json: bool) -> ExitCode:
    """Reports what would run and why, and how long it would take."""
    plans = clip_run.plan(clip, options)
    rows = []
    for plan in plans:
        outcome = Outcome.CACHED if plan.up_to_date else Outcome.PLANNED
        info = plan.record.info if plan.record is not None else None
        reporter.foresees(plan.stage, outcome, info.seconds if info else 0.0, f"{plan.reason.value}: {plan.sentence}")
        rows.append({"name": plan.stage, "status": outcome.value, "seconds": info.seconds if info else None,
                     "key": plan.parts.key if plan.parts else None, "reason": plan.reason.value})
    forecast = clip_run.foretell(clip, plans, options)
    if json:
        emit({"stages": rows, "outputs": {}, "metrics": {}, "quality": quality_entry(options.quality, clip_run.configs),
              "forecast": forecast.to_json()})
    return ExitCode.OK


def find_clip(path: Path) -> Path:
    """Absolute path of the clip. BadInput where there is none."""
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder; give a video or a folder of photos")
    return path.resolve()


def default_out(clip: Path) -> Path:
    """`<clip>-avatar` here."""
    return Path.cwd() / avatar_name(clip)


def run_clip(clip: Path, out: Path, store: Store, reporter: PlainReporter, quality: str) -> None:
    """All stages as a preset has them."""
    project = Project.at_hand()
    configs = resolve_quality(quality, project)
    run_folder = RunFolder(out)
    run_folder.say = reporter.note
    run_folder.refuse_foreign(find_clip(clip), project)
    with run_folder.hold():
        run_folder.prepare(find_clip(clip), project, configs)
        store = writable_store(store, out / OWN_STORE, reporter)
        carry_out(ClipRun(project, configs, store, run_folder, reporter), find_clip(clip), Options(quality=quality), reporter,
                  json=False)
