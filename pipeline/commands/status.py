"""gsac status: what is up to date in the folder of a run."""

from __future__ import annotations

import argparse
import dataclasses

from gsac.pipeline.commands.options import add_json, add_params, add_run_folder, answer_reporter, plan_run
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.plan import Reason


def declare(command: argparse.ArgumentParser) -> None:
    add_run_folder(command)
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with answer_reporter(arguments) as reporter:
        clip_run, plans = plan_run(arguments, reporter)
        plans = [
            dataclasses.replace(plan, reason=Reason.OUTPUT)
            if plan.cached is not None and not clip_run.folder.shows(clip_run.store, plan.cached) else plan for plan in plans
        ]
        for plan in plans:
            why = "" if plan.up_to_date else plan.sentence
            reporter.note(f"{plan.stage:<10} {plan.reason.value:<18} {why}".rstrip())
    up_to_date = all(plan.up_to_date for plan in plans)
    if arguments.json:
        emit({"up_to_date": up_to_date, "stages": [
            {"name": plan.stage, "up_to_date": plan.up_to_date, "reason": plan.reason.value, "why": plan.sentence,
             "key": plan.parts.key if plan.parts else None} for plan in plans]})
    return ExitCode.OK if up_to_date else ExitCode.STALE
