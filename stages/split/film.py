"""The video of a folder that holds one beside its masks, told by names: nothing is opened."""

from __future__ import annotations

from pathlib import Path

VIDEO_SUFFIXES = {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"}
MASKS = "masks"
"""Name of the folder of masks that lies beside the video or the photos."""


def find_film(folder: Path) -> Path | None:
    """None where the folder has no masks, or not exactly one video."""
    if not (folder / MASKS).is_dir():
        return None
    videos = [file for file in folder.iterdir() if file.suffix.lower() in VIDEO_SUFFIXES and not file.name.startswith(".")]
    return videos[0] if len(videos) == 1 else None
