"""The ffmpeg program that all video goes through."""

from __future__ import annotations

import os

CHOSEN_BY = "IMAGEIO_FFMPEG_EXE"
"""The variable by which imageio-ffmpeg takes another program, whose bytes would be kept as if its own had made them."""


def ffmpeg_program() -> str:
    """Path of the program that the package imageio-ffmpeg brings, whatever the environment says."""
    import imageio_ffmpeg

    os.environ.pop(CHOSEN_BY, None)
    return imageio_ffmpeg.get_ffmpeg_exe()
