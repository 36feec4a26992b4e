"""gsac status"""

from __future__ import annotations

import argparse
import dataclasses

from gsac.pipeline.commands.options import add_json, add_params, add_workspace, answers, open_store_of, open_workspace
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.plan import Reason
from gsac.pipeline.run import Chain, Options


def declare(command: argparse.ArgumentParser) -> None:
    add_workspace(command)
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    workspace, project, configs = open_workspace(arguments, arguments.folder)
    with answers(arguments) as voice:
        store = open_store_of(workspace, voice)
        chain = Chain(project, configs, store, workspace, voice)
        verdicts = [
            dataclasses.replace(v, reason=Reason.OUTPUT) if v.current and not workspace.shows(store, v.record) else v
            for v in chain.forecast(workspace.require_clip(), Options())
        ]
        for verdict in verdicts:
            why = "" if verdict.current else verdict.sentence
            voice.note(f"{verdict.stage:<10} {verdict.reason.value:<18} {why}".rstrip())
    current = all(verdict.current for verdict in verdicts)
    if arguments.json:
        emit({"up_to_date": current, "stages": [
            {"name": v.stage, "up_to_date": v.current, "reason": v.reason.value, "why": v.sentence,
             "key": v.parts.key if v.parts else None} for v in verdicts]})
    return ExitCode.OK if current else ExitCode.STALE
