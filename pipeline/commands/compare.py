"""gsac compare A B: writes a page that shows two runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.pipeline.commands.options import add_force, progress_reporter, require_free
from gsac.pipeline.lost_files import require_files
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run_folder import RUN
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("first", type=Path, metavar="A", help="the folder of a run")
    command.add_argument("second", type=Path, metavar="B", help="the folder of another run")
    command.add_argument("--out", type=Path, metavar="FILE", help="default: compare-A-B.html, here")
    add_force(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    for folder in (arguments.first, arguments.second):
        if not (folder / RUN).is_file():
            raise BadInput(f"{folder}: not the folder of a run (no {RUN}); `gsac run CLIP --out DIR` makes one")
        require_files(folder)
    page = arguments.out or Path(f"compare-{arguments.first.resolve().name}-{arguments.second.resolve().name}.html")
    if not page.parent.is_dir():
        raise BadInput(f"--out {page}: expected a file in a folder that exists")
    require_free(page, arguments.force)
    from gsac.pipeline.report.compare import write_comparison

    with progress_reporter(arguments) as reporter:
        reporter.note(f"draws the charts and pictures of {arguments.first} and {arguments.second} anew, which takes a few seconds")
        write_comparison(arguments.first, arguments.second, page)
    print(page)
    return ExitCode.OK
