"""gsac fixtures DIR: what every stage of a finished run read, as plain files that replay it elsewhere."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from gsac.cache.digest import tree_files
from gsac.cache.half_made import half_made
from gsac.pipeline.commands.options import add_json
from gsac.pipeline.fixtures import MANIFEST, cut_fixtures
from gsac.pipeline.json_output import emit
from gsac.pipeline.lost_files import require_files
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.project import Project
from gsac.pipeline.run_folder import RunFolder
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", type=Path, metavar="DIR", help="the folder of a run")
    command.add_argument("--out", type=Path, metavar="FOLDER", required=True, help="gets the fixtures; must not exist yet")
    command.add_argument("--frames", type=int, metavar="N", help="the first N frames only, in all artifacts but the clip itself")
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    out = arguments.out.absolute()
    if arguments.frames is not None and arguments.frames < 1:
        raise BadInput(f"--frames {arguments.frames}: expected 1 or more")
    if os.path.lexists(out) or not out.parent.is_dir():
        raise BadInput(f"--out {out}: expected a folder that does not exist yet, in one that does")
    run = RunFolder.around(arguments.folder)
    require_files(run.root)
    with run.hold(), half_made(out.parent) as (temp, _):
        (temp / out.name).mkdir()
        manifest = cut_fixtures(run, run.project(Project.at_hand()), temp / out.name, arguments.frames)
        os.rename(temp / out.name, out)
    if arguments.json:
        sizes = [file.stat().st_size for file in tree_files(out).values()]
        emit({"stages": [], "outputs": {"manifest": str(out / MANIFEST)},
              "metrics": {"files": len(sizes), "bytes": sum(sizes), "stages": len(manifest["stages"])}})
    else:
        print(out)
    return ExitCode.OK
