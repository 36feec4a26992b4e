"""The ffmpeg program that all video goes through."""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path


def ffmpeg_program() -> str:
    """Path of the program that the package imageio-ffmpeg brings, else of the one on the PATH.

    Found without importing that package, since each run asks; and whatever its variable IMAGEIO_FFMPEG_EXE says, whose program's
    bytes would be kept as if its own had made them.
    """
    spec = find_spec("imageio_ffmpeg")
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        for program in sorted(Path(folder, "binaries").glob("ffmpeg-*")):
            return str(program)
    return shutil.which("ffmpeg") or "ffmpeg"
