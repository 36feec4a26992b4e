"""gsac explain STAGE: what changed in its key since the most similar earlier run."""

from __future__ import annotations

import argparse

from gsac.cache.key import KeyParts
from gsac.pipeline.commands.options import add_json, add_params, add_run_folder, answer_reporter, open_clip_run
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run import Options


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("stage", metavar="STAGE", help="its name in dvc.yaml")
    add_run_folder(command)
    command.add_argument("--all", action="store_true", help="also list every part of the key")
    add_params(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with answer_reporter(arguments) as reporter:
        clip_run = open_clip_run(arguments, reporter)
        plan = clip_run.plan(clip_run.folder.require_clip(), Options(until=arguments.stage))[-1]
        reporter.note(f"{plan.stage}: {plan.reason.value}")
        if not plan.changes:
            reporter.note(f"  {plan.sentence}")
        for change in plan.changes:
            reporter.note(f"  {change.sentence}")
        if plan.parts is not None:
            lines = part_lines(plan.parts)
            reporter.note(f"key {plan.parts.key}, {len(lines)} parts{'' if arguments.all else ' (--all lists them)'}")
            for line in lines if arguments.all else ():
                reporter.note(f"  {line}")
    if arguments.json:
        emit({"stage": plan.stage, "reason": plan.reason.value,
              "key": plan.parts.key if plan.parts else None,
              "changes": [
                  {"kind": c.kind.value, "name": c.name, "before": c.before, "after": c.after, "why": c.sentence}
                  for c in plan.changes
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
