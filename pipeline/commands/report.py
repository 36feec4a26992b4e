"""gsac report DIR: writes report.html of a run's folder again."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.pipeline.lost_files import require_files
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run_folder import REPORT, RUN
from gsac.stages.contract import BadInput

if TYPE_CHECKING:
    from gsac.pipeline.report.results import Results


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", type=Path, metavar="DIR", help="the folder of a run")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    if not (arguments.folder / RUN).is_file():
        raise BadInput(f"{arguments.folder}: not the folder of a run (no {RUN}); `gsac run CLIP --out DIR` makes one")
    require_files(arguments.folder)
    from gsac.pipeline.report.page import write_report
    from gsac.pipeline.report.results import Results

    results = Results(arguments.folder)
    if not results.has_run:
        raise BadInput(f"{arguments.folder / RUN}: not the record of a run; run the clip again to write it anew")
    if (dead := dead_link(results)) is not None:
        raise BadInput(f"{dead} is a link to {os.readlink(dead)}, which is gone; `gsac run {results.run.get('clip')} --out "
                       f"{arguments.folder}` brings the results back, and {REPORT} stays as it is until then")
    print(write_report(arguments.folder))
    return ExitCode.OK


def dead_link(results: Results) -> Path | None:
    """The first output that is a link to nothing; None where all are there or truly absent."""
    paths = [results.root / port for step in results.project.graph.steps.values() for port in step.outs]
    return next((path for path in paths if path.is_symlink() and not path.exists()), None)
