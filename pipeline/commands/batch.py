"""gsac batch FOLDER | LIST: many clips over one cache."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from gsac.pipeline.batch import find_clips, make_jobs, run_batch
from gsac.pipeline.batch_reporter import BatchReporter, open_batch_reporter
from gsac.pipeline.commands.options import (
    add_json,
    add_params,
    add_person,
    add_quality,
    open_store,
    progress_reporter,
    values_of_person,
)
from gsac.pipeline.executors import EXECUTORS, check_executor
from gsac.pipeline.executors.executor import ClipResult
from gsac.pipeline.json_output import emit
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.pace import duration
from gsac.pipeline.project import Project
from gsac.pipeline.quality import STANDARD, resolve_quality
from gsac.pipeline.report.batch import PAGE, BatchPage
from gsac.pipeline.reporter import PlainReporter
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("source", type=Path, metavar="FOLDER|LIST",
                         help="a folder of clips, or a file with one path a line")
    command.add_argument("--out", type=Path, default=Path("."), metavar="DIR",
                         help=f"gets a folder a clip, and {PAGE}, which shows all of them (default: here)")
    command.add_argument("--executor", default="local", metavar="NAME", help=f"one of: {', '.join(EXECUTORS)}")
    command.add_argument("-j", "--jobs", type=int, metavar="N", help="clips at once (default: half as many as cores)")
    command.add_argument("--until", metavar="STAGE", help="stop after this stage")
    command.add_argument("--replace", action="store_true", help="put a clip's avatar in place of another clip's in its folder")
    add_quality(command)
    add_person(command)
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    reporter = progress_reporter(arguments)
    workers = max(1, (os.cpu_count() or 1) // 2) if arguments.jobs is None else arguments.jobs
    if workers < 1:
        raise BadInput(f"--jobs {arguments.jobs}: expected at least 1")
    check_executor(arguments.executor)
    project = Project.at_hand()
    configs = resolve_quality(arguments.quality, project, arguments.params, arguments.set, values_of_person(arguments, project))
    stages = set(project.graph.steps)
    if arguments.until:
        project.graph.step(arguments.until)
        stages = project.graph.above(arguments.until) | {arguments.until}
    keys = Keys(project, configs, open_store(reporter))
    keys.check(stages)  # one error now, not one a clip
    jobs = make_jobs(find_clips(arguments.source), arguments.out, forwarded_arguments(arguments))
    keys.pull_models(stages, reporter.note)
    page = BatchPage(arguments.out, jobs)
    reporter.note(f"{len(jobs)} clips, {min(workers, len(jobs))} at once")
    with open_batch_reporter(reporter, len(jobs)) as table:
        executor = EXECUTORS[arguments.executor](workers, lambda job, line: table.hear(job.name, line))
        results = run_batch(jobs, executor, lambda result: end(result, table, page, reporter))
    failed = [result for result in results if result.code != ExitCode.OK]
    reporter.result(f"{len(results) - len(failed)} of {len(results)} clips are done")
    for result in failed:
        reporter.result(f"failed: {result.job.clip}: {result.error}")
    if arguments.json:
        emit({"outputs": {"page": str(page.path)} if page.path.exists() else {}, "clips": [{
            "clip": str(r.job.clip), "out": str(r.job.out), "status": "failed" if r.code else "done", "code": r.code,
            "seconds": round(r.seconds, 3), "error": r.error or None, **r.summary} for r in results]})
    elif page.path.exists():
        print(page.path)
    return ExitCode.FAILED if failed else ExitCode.OK


def forwarded_arguments(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Arguments of every clip's `gsac run`."""
    told = ["--params", str(arguments.params.absolute())] if arguments.params else []
    told += [] if arguments.quality == STANDARD else ["--quality", arguments.quality]
    told += [] if arguments.height is None else ["--height", str(arguments.height)]
    told += [] if arguments.body is None else ["--body", arguments.body]
    told += [word for text in arguments.set for word in ("--set", text)]
    told += ["--replace"] if arguments.replace else []
    return tuple(told + (["--until", arguments.until] if arguments.until else []))


def end(result: ClipResult, table: BatchReporter, page: BatchPage, reporter: PlainReporter) -> None:
    """Tells of a clip's end, and shows it on the page; where that fails the batch goes on."""
    table.end(result.job.name, describe(result))
    try:
        page.add(result)
    except Exception as error:
        reporter.note(f"gsac: warning: {page.path} could not be written ({type(error).__name__}: {error})")


def describe(result: ClipResult) -> str:
    """One clip's line."""
    rows = result.summary.get("stages", [])
    ran = sum(row["status"] == "ran" for row in rows)
    warnings = sum(len(row["warnings"]) for row in rows)
    end = "failed" if result.code else f"done, {ran} of {len(rows)} stages ran"
    return f"{result.job.name}: {end}, {warnings} warnings, {duration(result.seconds)}"
