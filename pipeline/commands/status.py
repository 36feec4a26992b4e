"""gsac status: what is up to date in the folder of a run."""

from __future__ import annotations

import argparse
import dataclasses

from gsac.pipeline.commands.options import add_json, add_params, add_run_folder, answer_reporter, plan_run
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.plan import Reason, StagePlan
from gsac.pipeline.run import ClipRun


def declare(command: argparse.ArgumentParser) -> None:
    add_run_folder(command)
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with answer_reporter(arguments) as reporter:
        clip_run, plans = plan_run(arguments, reporter)
        plans = [beside_folder(plan, clip_run) for plan in plans]
        for plan in plans:
            why = "" if plan.up_to_date else plan.sentence
            reporter.note(f"{plan.stage:<10} {plan.reason.value:<18} {why}".rstrip())
    up_to_date = all(plan.up_to_date for plan in plans)
    if arguments.json:
        emit({"up_to_date": up_to_date, "stages": [
            {"name": plan.stage, "up_to_date": plan.up_to_date, "reason": plan.reason.value, "why": plan.sentence,
             "key": plan.parts.key if plan.parts else None} for plan in plans]})
    return ExitCode.OK if up_to_date else ExitCode.STALE


def beside_folder(plan: StagePlan, clip_run: ClipRun) -> StagePlan:
    """The plan of a stage, not up to date where the folder shows another result than the cache, or less."""
    record = plan.cached
    if record is None or clip_run.folder.shows(clip_run.store, record):
        return plan
    there = all(clip_run.folder.path(f"{plan.stage}/{output}").exists() for output in record.outputs)
    return dataclasses.replace(plan, reason=Reason.OUTPUT if there else Reason.NOT_SHOWN)
