"""gsac convert AVATAR FORMAT: the avatar as a file that export does not write: VRM, USDZ, SOG or splats in glTF."""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path
from typing import get_args

from gsac.cache.half_made import half_made
from gsac.pipeline.avatar_file import EXPORT, find_avatar, folder_around, name_avatar, refuse_footage
from gsac.pipeline.commands.options import add_force, add_json, progress_reporter, require_free, warn_stale
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.stages.contract import BadInput, did_you_mean
from gsac.stages.export.config import Pose

FORMATS = {
    "vrm": "VRM 1.0, a humanoid with expressions for VTuber programs and social worlds",
    "usdz": "for Quick Look on iPhone, iPad and Mac, moving as the first clip does",
    "sog": "gaussians in one pose for PlayCanvas and SuperSplat",
    "glb": "gaussians in one pose, alone, with KHR_gaussian_splatting",
}
"""Suffix -> what it is for."""
POSED = ("sog", "glb")
"""Of these, those whose gaussians stand still in one pose."""


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("avatar", type=Path, metavar="AVATAR", help="avatar.gsac, or the folder of a run or its export folder")
    command.add_argument("format", metavar="FORMAT",
                         help="; ".join(f"{name}: {words}" for name, words in FORMATS.items()))
    command.add_argument("--pose", metavar="NAME",
                         help=f"pose of the gaussians in {' or '.join(POSED)}: a (arms half down) or t (arms out); default: a")
    command.add_argument("--out", type=Path, metavar="FILE", help="default: <avatar>.<FORMAT>, here")
    add_force(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    if arguments.format not in FORMATS:
        raise BadInput(f"unknown format {arguments.format}{did_you_mean(arguments.format, FORMATS)}; known: {', '.join(FORMATS)}")
    if arguments.pose not in (None, *get_args(Pose)):
        raise BadInput(f"--pose {arguments.pose}: expected {' or '.join(get_args(Pose))}")
    if arguments.pose is not None and arguments.format not in POSED:
        raise BadInput(f"--pose {arguments.pose}: {arguments.format} has no pose of its own, since it moves; leave it out, or "
                       f"choose {' or '.join(POSED)}")
    file = find_avatar(arguments.avatar)
    out = (arguments.out or Path(f"{name_avatar(file)}.{arguments.format}")).absolute()
    if out.suffix.lower() != f".{arguments.format}" or not out.parent.is_dir():
        raise BadInput(f"--out {out}: expected a file .{arguments.format} in a folder that exists")
    refuse_footage(out, file)
    require_free(out, arguments.force)
    began = time.monotonic()
    with progress_reporter(arguments) as reporter:
        warn_stale(folder_around(file), reporter, EXPORT)
    size = write(file, arguments.format, arguments.pose, out)
    if arguments.json:
        row = {"name": "convert", "status": Outcome.RAN.value, "seconds": time.monotonic() - began, "key": None}
        emit({"stages": [row], "outputs": {arguments.format: str(out)}, "metrics": {"bytes": size}})
    else:
        print(out)
    return ExitCode.OK


def write(file: Path, kind: str, pose: Pose | None, out: Path) -> int:
    """Writes the avatar `file` in a format, whole or not at all. Returns the number of bytes. pose: of POSED, `a` if None."""
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.files import write_file
    from gsac.avatar.gsac_file.rigged import RiggedAvatar
    from gsac.stages.export.on_request import POSED_WRITERS, WRITERS

    try:
        avatar = RiggedAvatar.read(file)
        content = POSED_WRITERS[kind](avatar, pose or "a") if kind in POSED else WRITERS[kind](avatar)
    except ArtifactError as e:
        raise BadInput(str(e)) from e
    with half_made(out.parent) as (folder, _):
        write_file(folder / out.name, content)
        os.replace(folder / out.name, out)
    return len(content)
