"""The last lines of a run: how good the avatar is, where it lies, what to do next."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Any

from gsac.pipeline.run_folder import REPORT, RunFolder

RESULTS = {"avatar": Path("export") / "avatar.gsac", "viewer": Path("export") / "viewer.html", "report": Path(REPORT)}
"""What a person opens, below the folder of a run."""


def closing_lines(folder: RunFolder, metrics: dict[str, Any]) -> list[str]:
    """Verdict, paths of what is there, and the next command. metrics: of the run, {} without training."""
    lines = [f"verdict: {verdict_line(metrics)}"] if "psnr_fg" in metrics else []
    lines += [f"{name + ':':<8} {folder.root / path}" for name, path in RESULTS.items() if (folder.root / path).exists()]
    if (folder.root / RESULTS["viewer"]).exists():
        lines.append(f"next:    gsac view {shlex.quote(shortest(folder.root))}")
    return lines


def verdict_line(metrics: dict[str, Any]) -> str:
    """The report's verdict in one sentence."""
    from gsac.pipeline.report.quality import grade

    return f"{grade(metrics)}."


def shortest(path: Path) -> str:
    """The path as it is typed from here: relative where it lies below the current folder."""
    here = Path(os.getcwd())
    return str(path.relative_to(here)) if path.is_relative_to(here) and path != here else str(path)
