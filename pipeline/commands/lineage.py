"""gsac lineage ARTIFACT: from an avatar back to the clip, with parameters, code, model files, packages, device and time."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

from gsac.avatar.network_files import licence_of
from gsac.cache.record import Record
from gsac.pipeline.commands.options import add_json, answer_reporter, find_store, open_store_of
from gsac.pipeline.json_output import emit
from gsac.pipeline.lineage import Lineage, code_digest, run_folder_around, trace
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.params import config_values
from gsac.pipeline.project import Project
from gsac.stages.counting import counted


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("artifact", metavar="ARTIFACT|RUN",
                         help="an output of a stage, file or folder, wherever it lies; its digest or key; or the folder of a run")
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    reporter = answer_reporter(arguments)
    path = Path(arguments.artifact)
    folder = run_folder_around(path) if os.path.lexists(path) else None
    store = open_store_of(folder, reporter) if folder is not None else find_store(reporter)
    found = trace(store, folder, path if os.path.lexists(path) else arguments.artifact)
    for line in describe(found, Project.at_hand()):
        reporter.note(line)
    if arguments.json:
        emit(found.to_json())
    return ExitCode.OK


def describe(found: Lineage, project: Project) -> Iterator[str]:
    """Lines for people: each stage, the last first, and the clip."""
    for record in found.records:
        parts, info = record.parts, record.info
        yield f"{parts.stage}  {record.key[:12]}  {info.seconds:.1f} s on {info.device}, {info.started or 'at an unknown time'}"
        yield f"  gave        {named(record.outputs)}"
        yield f"  made from   {named(parts.inputs)}"
        yield f"  parameters  {parameters(record, project)}"
        yield f"  code        {code_digest(parts.code)[:12]} of {len(parts.code)} modules and files"
        for name, sha256 in parts.models.items():
            yield f"  model file  {name} {sha256[:12]} ({licence_of(name, sha256)})"
        if parts.packages:
            yield f"  packages    {', '.join(f'{name} {version}' for name, version in parts.packages.items())}"
        if record.key in found.others:
            yield f"  {counted(found.others[record.key], 'other run')} gave the same bytes"
    for port, digest in found.lost.items():
        yield f"{port}  {digest[:12]}  its record is not in the cache any more"
    for digest, paths in found.clips.items():
        yield f"clip  {digest[:12]}  {', '.join(paths) or 'no folder of a run here shows it'}"
    for paper in found.papers:
        yield f"paper  {paper}"


def named(digests: dict[str, str]) -> str:
    """`body.npz 1a2b3c4d5e6f, ...`"""
    return ", ".join(f"{name} {digest[:12]}" for name, digest in digests.items())


def parameters(record: Record, project: Project) -> str:
    """Those that are not as by default, or that this code does not know."""
    stage = record.parts.stage
    defaults = config_values(project.stage(stage).config()) if stage in project.graph.steps else {}
    other = {name: value for name, value in record.parts.params.items() if name not in defaults or value != defaults[name]}
    rest = len(record.parts.params) - len(other)
    return ", ".join([*(f"{name}={value}" for name, value in other.items()), f"{rest} by default"])
