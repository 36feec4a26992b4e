"""The video of a folder that holds one, alone or beside its masks or its plate, told by names: nothing is opened."""

from __future__ import annotations

from pathlib import Path

VIDEO_SUFFIXES = {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"}
HEIC = {".heic", ".heif"}
"""As iPhones write them."""
PHOTO_SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff"} | HEIC
PLATE = "plate"
"""Name, without ending, of the picture of the empty scene that lies beside the video or the photos."""
MASKS = "masks"
"""Name of the folder of masks that lies beside the video or the photos."""


def find_film(folder: Path) -> Path | None:
    """None where the folder has photos without masks, or not exactly one video."""
    if not folder.is_dir():
        return None
    files = [file for file in folder.iterdir() if not file.name.startswith(".")]
    photos = {file.stem.lower() for file in files if file.suffix.lower() in PHOTO_SUFFIXES}
    if photos - {PLATE} and not (folder / MASKS).is_dir():
        return None
    videos = [file for file in files if file.suffix.lower() in VIDEO_SUFFIXES]
    return videos[0] if len(videos) == 1 else None


def find_plates(folder: Path) -> list[Path]:
    """The pictures of the empty scene in a folder: one, where it is as it should be."""
    return sorted(file for file in folder.iterdir() if file.stem.lower() == PLATE and file.suffix.lower() in PHOTO_SUFFIXES)
