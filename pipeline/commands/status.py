"""gsac status: what is up to date in the folder of a run."""

from __future__ import annotations

import argparse
import dataclasses

from gsac.pipeline.commands.options import add_json, add_params, add_run_folder, answer_reporter, open_clip_run
from gsac.pipeline.errors import attach_summary
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.plan import Reason, StagePlan
from gsac.pipeline.rows import clip_entries
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.sources import source_digest
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    add_run_folder(command)
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with answer_reporter(arguments) as reporter:
        clip_run = open_clip_run(arguments, reporter)
        digest, fault = clip_digest(clip_run)
        plans = [beside_folder(plan, clip_run) for plan in clip_run.plan_of(digest, Options())]
        for plan in plans:
            why = "" if plan.up_to_date else plan.sentence
            reporter.note(f"{plan.stage:<10} {plan.reason.value:<18} {why}".rstrip())
    up_to_date = fault is None and all(plan.up_to_date for plan in plans)
    answer = {"up_to_date": up_to_date, "stages": [
        {"name": plan.stage, "up_to_date": plan.up_to_date, "reason": plan.reason.value, "why": plan.sentence,
         "key": plan.parts.key if plan.parts else None} for plan in plans]}
    if fault is not None:
        attach_summary(fault, answer)
        raise fault
    if arguments.json:
        emit(answer)
    return ExitCode.OK if up_to_date else ExitCode.STALE


def clip_digest(clip_run: ClipRun) -> tuple[str, BadInput | None]:
    """Tree digest of the clip; where the clip is gone or cannot be read, that of the last run, and the fault. BadInput where no run
    has noted one."""
    try:
        return source_digest(clip_run.folder.require_clip(), clip_run.store), None
    except BadInput as fault:
        digest = clip_entries(clip_run.folder, clip_run.store)["clip_digest"]
        if digest is None:
            raise
        return digest, fault


def beside_folder(plan: StagePlan, clip_run: ClipRun) -> StagePlan:
    """The plan of a stage, not up to date where the folder shows another result than the cache, or less."""
    record = plan.cached
    if record is None or clip_run.folder.shows(clip_run.store, record):
        return plan
    there = all(clip_run.folder.path(f"{plan.stage}/{output}").exists() for output in record.outputs)
    return dataclasses.replace(plan, reason=Reason.OUTPUT if there else Reason.NOT_SHOWN)
