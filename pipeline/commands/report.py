"""gsac report DIR: writes report.html of a run's folder again."""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.pipeline.lost_files import require_files
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run_folder import RUN, RunFolder
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", type=Path, metavar="DIR", help="the folder of a run")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    if not (arguments.folder / RUN).is_file():
        raise BadInput(f"{arguments.folder}: not the folder of a run (no {RUN}); `gsac run CLIP --out DIR` makes one")
    require_files(arguments.folder)
    from gsac.pipeline.report.page import write_report
    from gsac.pipeline.report.results import Results

    if not Results(arguments.folder).has_run:
        raise BadInput(f"{arguments.folder / RUN}: not the record of a run; run the clip again to write it anew")
    with RunFolder(arguments.folder).hold():
        print(write_report(arguments.folder))
    return ExitCode.OK
