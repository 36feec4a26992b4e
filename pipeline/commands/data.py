"""gsac data import: a downloaded data set as folders that `gsac run` takes."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from gsac.pipeline.commands.options import progress_reporter
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput
from gsac.stages.counting import counted


def declare(command: argparse.ArgumentParser) -> None:
    from gsac.pipeline.data_sets.read import DATA_SETS

    does = command.add_subparsers(dest="does", required=True, metavar="import")
    one = does.add_parser("import", help="write frames, masks, cameras, poses and the published split of a data set")
    one.add_argument("name", choices=DATA_SETS, metavar="NAME", help=f"its layout: {', '.join(DATA_SETS)}")
    one.add_argument("path", type=Path, metavar="PATH", help="folder of one subject or scene, or of several")
    one.add_argument("--out", type=Path, default=Path("data"), metavar="DIR",
                     help="where a folder for each subject is made (default: ./data)")
    one.set_defaults(do=do_import)


def do_import(arguments: argparse.Namespace) -> ExitCode:
    from gsac.pipeline.data_sets.read import read_data_set
    from gsac.pipeline.data_sets.write import write_clip

    reporter, there, made = progress_reporter(arguments), [], 0
    for clip in read_data_set(arguments.name, arguments.path):
        folder = arguments.out / clip.name
        if folder.exists():
            there.append(folder)
            reporter.note(f"{folder} is there already and left as it is")
            continue
        write_clip(clip, folder)
        made += 1
        test = f", {len(clip.test)} of them to test ({clip.split_source})" if clip.test else ""
        masks = "with masks" if clip.masked else "without masks, which stage segment will make"
        reporter.result(f"{folder}: {counted(len(clip.numbers), 'frame')} {masks}{test}")
        brought = ("--set", "segment.method=brought") if clip.masked else ()
        reporter.note(shlex.join(("gsac", "run", str(folder), *brought, "--set", f"split.photo_fps={clip.fps:g}", "--set",
                                  "split.count=null")))
    if there and not made:
        raise BadInput(f"{there[0]}: is there already; remove it or give another --out")
    return ExitCode.OK
