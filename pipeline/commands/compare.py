"""gsac compare A B: writes a page that shows two runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.pipeline.commands.options import progress_reporter
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run_folder import RUN
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("first", type=Path, metavar="A", help="the folder of a run")
    command.add_argument("second", type=Path, metavar="B", help="the folder of another run")
    command.add_argument("--out", type=Path, metavar="FILE", help="default: compare-A-B.html, here")
    command.add_argument("--force", action="store_true", help="write over FILE if it is there")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    for folder in (arguments.first, arguments.second):
        if not (folder / RUN).is_file():
            raise BadInput(f"{folder}: not the folder of a run (no {RUN}); `gsac run CLIP --out DIR` makes one")
    page = arguments.out or Path(f"compare-{arguments.first.resolve().name}-{arguments.second.resolve().name}.html")
    if page.exists() and not arguments.force:
        raise BadInput(f"{page} exists; give another --out, or --force to write over it")
    if not page.parent.is_dir():
        raise BadInput(f"{page.parent}: no such folder; make it, or give another --out")
    from gsac.pipeline.report.compare import write_comparison

    with progress_reporter(arguments) as reporter:
        reporter.note(f"draws the charts and pictures of {arguments.first} and {arguments.second} anew, which takes a few seconds")
        write_comparison(arguments.first, arguments.second, page)
    print(page)
    return ExitCode.OK
