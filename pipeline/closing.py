"""The last lines of a run: how good the avatar is, where it lies, what to do next."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from pathlib import Path

from gsac.pipeline.report.origin import read_origin
from gsac.pipeline.run_folder import REPORT, RunFolder

RESULTS = {"avatar": Path("export") / "avatar.gsac", "viewer": Path("export") / "viewer.html", "report": Path(REPORT)}
"""What a person opens, below the folder of a run."""


def closing_lines(folder: RunFolder) -> list[str]:
    """The report's verdict, paths of what is there, and the next command."""
    origin = read_origin(folder.root / REPORT)
    lines = [f"verdict: {origin.verdict}"] if origin is not None and origin.verdict else []
    lines += [f"{name + ':':<8} {folder.root / path}" for name, path in RESULTS.items() if (folder.root / path).exists()]
    if (folder.root / RESULTS["viewer"]).exists():
        lines.append(f"next:    {program()} view {typed(shortest(folder.root))}")
    return lines


def program() -> str:
    """`gsac`, or as it was called where that alone is not found."""
    called = sys.argv[0]
    return shlex.quote(called) if Path(called).name == "gsac" and shutil.which("gsac") is None else "gsac"


def typed(path: str) -> str:
    """The path as a shell reads it; one that cannot be printed in the form $'\\xff' of bash and zsh."""
    if path.isprintable():
        return shlex.quote(path)
    escaped = path.replace("\\", "\\\\").replace("'", "\\'")
    return f"$'{os.fsencode(escaped).decode('ascii', 'backslashreplace')}'"


def shortest(path: Path) -> str:
    """The path as it is typed from here: relative where it lies below the current folder."""
    here = Path(os.getcwd())
    return str(path.relative_to(here)) if path.is_relative_to(here) and path != here else str(path)
