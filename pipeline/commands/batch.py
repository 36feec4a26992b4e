"""gsac batch FOLDER | LIST: many clips over one cache."""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path
from typing import Any

from gsac.pipeline.batch import find_clips, make_jobs, run_batch
from gsac.pipeline.batch_entry import Entry, Status
from gsac.pipeline.batch_plan import BatchPlanner, ClipPlan
from gsac.pipeline.batch_record import FILE, BatchRecord, read_request
from gsac.pipeline.batch_reporter import open_batch_reporter
from gsac.pipeline.clip_end import clip_end
from gsac.pipeline.clip_work import ClipWork
from gsac.pipeline.commands.options import (
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
from gsac.pipeline.event_file import EventFile, others_files
from gsac.pipeline.events import BatchEnded, BatchStarted, ClipKept, ClipPlanned, Event, StageLine, StageProgress
from gsac.pipeline.executors import EXECUTORS, check_executor
from gsac.pipeline.executors.executor import ClipJob, ClipResult, Limits
from gsac.pipeline.executors.memory import SHARE, machine_mb
from gsac.pipeline.journal import Journal
from gsac.pipeline.json_output import emit
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.pace import duration
from gsac.pipeline.project import Project
from gsac.pipeline.quality import STANDARD, resolve_quality
from gsac.pipeline.report.batch import PAGE, BatchPage
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.run import Options
from gsac.pipeline.unchanged import run_unchanged
from gsac.stages.contract import BadInput
from gsac.stages.counting import counted

REQUEST = ("source", "until", "start", "force", "anyway", "replace", "quality", "height", "body", "params", "set")
"""Arguments that say which clips are run and how; `--resume` takes them from the batch that it goes on with."""


NOT_KEPT = (StageProgress, StageLine)
"""What the batch's file of events leaves to those in the clips' folders."""


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("source", type=Path, nargs="?", metavar="FOLDER|LIST",
                         help="a folder of clips, or a file with one path a line")
    command.add_argument("--out", type=Path, default=Path("."), metavar="DIR",
                         help=f"gets a folder a clip, {PAGE}, which shows all of them, and {FILE} (default: here)")
    command.add_argument("--executor", default="local", metavar="NAME", help=f"one of: {', '.join(EXECUTORS)}")
    command.add_argument("-j", "--jobs", type=int, metavar="N",
                         help="clips at once (default: half as many as cores; 1 on a GPU); not with --executor ray")
    command.add_argument("--memory", type=float, metavar="GB",
                         help=f"memory that clips at once may fill, by what they took before (default: {SHARE:g} of the machine's)")
    command.add_argument("--address", metavar="HOST:PORT",
                         help="of the Ray cluster (default: the one that RAY_ADDRESS names, else that of the last `ray start` "
                              "here, else this machine alone)")
    command.add_argument("--until", metavar="STAGE", help="stop after this stage")
    command.add_argument("--from", dest="start", metavar="STAGE", help="what this stage needs must be in the cache already")
    command.add_argument("--force", action="append", default=[], metavar="STAGE", help="run this stage again; may be repeated")
    command.add_argument("--anyway", action="store_true", help="go on where nothing can come of a clip, as without a person")
    command.add_argument("--replace", action="store_true", help="put a clip's avatar in place of another clip's in its folder")
    command.add_argument("--resume", action="store_true",
                         help="go on with the batch of --out that was stopped: its clips and arguments, but those that have ended")
    command.add_argument("--changed-only", action="store_true",
                         help="leave clips that the last batch of --out has done, and whose file is the same, as they are, though "
                              "code or parameters are others")
    command.add_argument("--dry-run", action="store_true",
                         help="say what each clip needs and how long it would take, and which cannot run, with the exit code of a "
                              "batch in which they fail")
    add_quality(command)
    add_person(command)
    add_params(command)
    add_json(command)
    add_events(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with progress_reporter(arguments) as reporter, open_journal(arguments, reporter, of_batch=True) as journal:
        return run(arguments, reporter, journal)


def run(arguments: argparse.Namespace, reporter: PlainReporter, journal: Journal) -> ExitCode:
    """The whole batch; reporter: what its table is drawn by."""
    began, request = time.monotonic(), take_request(arguments)
    check_arguments(arguments)
    project = Project.at_hand()
    configs = resolve_quality(arguments.quality, project, arguments.params, arguments.set, values_of_person(arguments, project))
    options = Options(arguments.until, arguments.start, tuple(arguments.force), arguments.quality, arguments.anyway)
    store = open_store(journal)
    planner = BatchPlanner(project, configs, store, options, arguments.replace)
    planner.keys.check(planner.steps)  # one error now, not one a clip
    jobs = make_jobs(find_clips(arguments.source), arguments.out, forwarded_arguments(arguments))
    refuse_others_events(arguments.out)
    record = BatchRecord(arguments.out, request, jobs)
    kept = {job: earlier for job in jobs if arguments.resume and (earlier := record.ended(job)) is not None}
    plans = planner.plan_all(job for job in jobs if job not in kept)
    if arguments.changed_only:
        kept |= {plan.job: earlier for plan in plans if (earlier := record.unchanged(plan)) is not None}
        plans = [plan for plan in plans if plan.job not in kept]
    workers = arguments.jobs or count_workers(planner.keys)
    limits = Limits(workers, arguments.memory * 1024 if arguments.memory else SHARE * machine_mb(), arguments.address)
    due = [plan for plan in plans if not plan.unchanged]
    journal.note(foretell(plans, len(kept), None if arguments.executor == "ray" else workers))
    page = BatchPage(arguments.out, jobs)
    if arguments.dry_run:
        return dry_run(plans, kept, reporter, arguments.json)
    planner.keys.pull_models({stage for plan in due for stage in plan.due}, journal.note)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with EventFile(arguments.out.absolute(), NOT_KEPT) as file, journal.heard_by(file.take), journal.heard_by(record.take):
        for job, earlier in kept.items():
            journal.tell(ClipKept(clip=job.name, status=earlier.status if arguments.resume else Status.KEPT))
            page.keep(job, earlier.error)
        for plan in plans:
            journal.tell(ClipPlanned(clip=plan.job.name, digest=plan.digest, due=list(plan.due), seconds=round(plan.seconds, 3)))
        record.write(now=True)
        journal.tell(BatchStarted(clips=len(jobs), due=len(due), executor=arguments.executor))

        def hear(job: ClipJob, event: Event, attempt: int = 1) -> None:
            journal.relay(event, job.name, attempt)

        def end(result: ClipResult) -> None:
            journal.tell(clip_end(result.code, result.seconds, result.error, result.summary, result.unchanged, result.killed,
                                  result.job.name))
            page.add(result, record.entries[result.job.name].before)
            if page.is_due:
                write_page(page, journal)

        work = ClipWork(project, configs, store, options, journal, arguments.replace)
        unchanged = run_unchanged(work, [plan.job for plan in plans if plan.unchanged], planner.keys, hear)
        times = {plan.job.name: plan.seconds for plan in due}
        try:
            with open_batch_reporter(reporter, times) as table, journal.heard_by(table.take):
                executor = EXECUTORS[arguments.executor](limits, hear)
                results = run_batch([plan.told_job for plan in due], executor, end, unchanged)
        finally:
            journal.tell(BatchEnded(seconds=round(time.monotonic() - began, 3), failed=len(record.failed)))
        record.write(now=True)
        write_page(page, journal)
        return conclude(record, {result.job.name: result for result in results}, page, journal, arguments.json)


def check_arguments(arguments: argparse.Namespace) -> None:
    """BadInput names an argument that cannot be, or that does not go with another one."""
    if arguments.jobs is not None and arguments.jobs < 1:
        raise BadInput(f"--jobs {arguments.jobs}: expected at least 1")
    if arguments.memory is not None and not arguments.memory > 0:
        raise BadInput(f"--memory {arguments.memory:g}: expected GB above 0")
    check_executor(arguments.executor)
    if arguments.address is not None and arguments.executor != "ray":
        raise BadInput(f"--address {arguments.address}: only --executor ray has one")
    if arguments.jobs is not None and arguments.executor == "ray":
        raise BadInput(f"--jobs {arguments.jobs}: on a cluster as many clips run at once as it has room for; leave it out")


def take_request(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the batch is to do, as batch.json keeps it; with --resume it is taken from there."""
    if arguments.resume:
        if arguments.source is not None:
            raise BadInput(f"--resume takes the clips from {arguments.out / FILE}; leave {arguments.source} out")
        if given := [name for name in REQUEST if getattr(arguments, name) not in (None, False, [], STANDARD)]:
            option = "--from" if given[0] == "start" else f"--{given[0]}"
            raise BadInput(f"--resume takes {option} from {arguments.out / FILE}, as the batch was begun; leave {option} out, or "
                           "begin a batch anew without --resume: what is the same comes from the cache")
        request = read_request(arguments.out.absolute() / FILE)
        for name in REQUEST:
            value = request.get(name)
            setattr(arguments, name, Path(value) if name in ("source", "params") and value is not None else value)
        return request
    if arguments.source is None:
        raise BadInput("no FOLDER or LIST was given; give a folder of clips, a file with one path a line, or --resume")
    return {name: str(value.absolute()) if isinstance(value := getattr(arguments, name), Path) else value for name in REQUEST}


def forwarded_arguments(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Arguments of every clip's `gsac run`."""
    told = ["--params", str(arguments.params.absolute())] if arguments.params else []
    told += [] if arguments.quality == STANDARD else ["--quality", arguments.quality]
    told += [] if arguments.height is None else ["--height", str(arguments.height)]
    told += [] if arguments.body is None else ["--body", arguments.body]
    told += [word for text in arguments.set for word in ("--set", text)]
    told += [word for stage in arguments.force for word in ("--force", stage)]
    told += ["--from", arguments.start] if arguments.start else []
    told += [f"--{word}" for word in ("anyway", "replace") if getattr(arguments, word)]
    return tuple(told + (["--until", arguments.until] if arguments.until else []))


def count_workers(keys: Keys) -> int:
    """Clips at once where nobody says: a GPU takes one, cores are shared by two."""
    return 1 if keys.device == "cuda" else max(1, (os.cpu_count() or 1) // 2)


def foretell(plans: list[ClipPlan], kept: int, workers: int | None) -> str:
    """The line before the start: how many clips need what, and how long it may take. workers: None where a cluster decides."""
    due = [plan for plan in plans if plan.due]
    unchanged = sum(plan.unchanged for plan in plans)
    parts = [counted(len(plans) + kept, "clip")]
    parts += [f"{unchanged} unchanged"] if unchanged else []
    parts += [f"{kept} left as they are"] if kept else []
    parts += [f"{refused} cannot run"] if (refused := sum(bool(plan.error) for plan in plans)) else []
    if not due:
        return ", ".join([*parts, "nothing to do"])
    at_once = min(workers or 1, len(due))
    seconds = sum(plan.seconds for plan in due) / at_once
    where = f"{at_once} at once" if workers is not None else "on the cluster"
    time = f"about {duration(seconds)}{'' if workers is not None else ' one after another'}" if seconds else ""
    return ", ".join([*parts, f"{len(due)} to do", where, *filter(None, [time])])


def dry_run(plans: list[ClipPlan], kept: dict[ClipJob, Entry], reporter: PlainReporter, json: bool) -> ExitCode:
    """A line for each clip that fails or needs something. FAILED where the batch would end so, as far as that is known before
    anything runs. kept: clips that are left as they are, which may be failures."""
    failed = {plan.job.name: plan.error for plan in plans if plan.error}
    failed |= {job.name: entry.error for job, entry in kept.items() if entry.status is Status.FAILED}
    for name, error in failed.items():
        reporter.result(f"{name}: {error}")
    for plan in plans:
        if plan.due:
            time = f", about {duration(plan.seconds)}" if plan.seconds else ""
            reporter.result(f"{plan.job.name}: {plan.due[0]} to {plan.due[-1]}{time}")
    if json:
        emit({"outputs": {}, "clips": [plan.to_json() for plan in plans]})
    return ExitCode.FAILED if failed else ExitCode.OK


def conclude(record: BatchRecord, results: dict[str, ClipResult], page: BatchPage, journal: Journal, json: bool) -> ExitCode:
    """The last lines and the object of --json. results: by name of the clip."""
    journal.result(f"{len(record.entries) - len(record.failed)} of {counted(len(record.entries), 'clip')} done")
    for entry in record.failed:
        journal.result(f"failed: {entry.clip}: {entry.error}")
    if json:
        files = {"page": page.path, "record": record.path}
        emit({"outputs": {name: str(path) for name, path in files.items() if path.exists()}, "clips": [
            (results[name].summary if name in results else {})
            | {"clip": entry.clip, "out": entry.out, "status": entry.status.value, "code": entry.code,
               "seconds": round(entry.seconds, 3), "error": entry.error or None} for name, entry in record.entries.items()]})
    elif page.path.exists():
        print(page.path)
    return ExitCode.FAILED if record.failed else ExitCode.OK


def write_page(page: BatchPage, journal: Journal) -> None:
    """Writes the page; where that fails the batch goes on."""
    try:
        page.write()
    except Exception as error:
        journal.note(f"gsac: warning: {page.path} could not be written ({type(error).__name__}: {error})")


def refuse_others_events(folder: Path) -> None:
    """BadInput where the files of events would be a user's."""
    for path in others_files(folder):
        raise BadInput(f"{path} was not written by gsac, which would append to it; move it away, or give another --out")
