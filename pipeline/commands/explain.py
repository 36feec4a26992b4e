"""gsac explain STAGE"""

from __future__ import annotations

import argparse

from gsac.cache.key import KeyParts
from gsac.pipeline.commands.options import add_json, add_params, add_workspace, answers, open_store_of, open_workspace
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run import Chain, Options


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("stage", metavar="STAGE")
    add_workspace(command)
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    workspace, project, configs = open_workspace(arguments, arguments.folder)
    project.graph.step(arguments.stage)
    with answers(arguments) as voice:
        chain = Chain(project, configs, open_store_of(workspace, voice), workspace, voice)
        verdict = chain.forecast(workspace.require_clip(), Options(until=arguments.stage))[-1]
        voice.note(f"{verdict.stage}: {verdict.reason.value}")
        if not verdict.changes:
            voice.note(f"  {verdict.sentence}")
        for change in verdict.changes:
            voice.note(f"  {change.sentence}")
        if verdict.parts is not None:
            voice.note(f"key {verdict.parts.key} is made of")
            for line in part_lines(verdict.parts):
                voice.note(f"  {line}")
    if arguments.json:
        emit({"stage": verdict.stage, "reason": verdict.reason.value,
              "key": verdict.parts.key if verdict.parts else None,
              "changes": [
                  {"kind": c.kind.value, "name": c.name, "before": c.before, "after": c.after, "why": c.sentence}
                  for c in verdict.changes
              ]})
    return ExitCode.OK


def part_lines(parts: KeyParts) -> list[str]:
    """The parts of a key, one a line."""
    groups = (("input", parts.inputs), ("parameter", parts.params), ("code", parts.code), ("model file", parts.models),
              ("package", parts.packages))
    lines = [f"{kind:<10} {name} = {_short(value)}" for kind, part in groups for name, value in part.items()]
    return lines + ([f"{'device':<10} {parts.device}"] if parts.device else [])


def _short(value: object) -> str:
    text = str(value)
    return text[:12] if isinstance(value, str) and len(text) == 64 else text
