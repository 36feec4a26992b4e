"""The video of a folder that holds one, alone or beside its masks or its plate, told by names: nothing is opened."""

from __future__ import annotations

from pathlib import Path

VIDEO_SUFFIXES = {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi", ".3gp", ".mts", ".ts", ".mpg", ".mpeg"}
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
    if find_photos(folder) and not (folder / MASKS).is_dir():
        return None
    videos = find_videos(folder)
    return videos[0] if len(videos) == 1 else None


def find_videos(folder: Path) -> list[Path]:
    """All videos of a folder."""
    return _files(folder, VIDEO_SUFFIXES)


def find_photos(folder: Path) -> list[Path]:
    """All photos of a folder but the plate."""
    return [file for file in _files(folder, PHOTO_SUFFIXES) if file.stem.lower() != PLATE]


def find_plates(folder: Path) -> list[Path]:
    """The pictures of the empty scene in a folder: one, where it is as it should be."""
    return [file for file in _files(folder, PHOTO_SUFFIXES) if file.stem.lower() == PLATE]


def _files(folder: Path, suffixes: set[str]) -> list[Path]:
    """In order, without the hidden ones."""
    return sorted(file for file in folder.iterdir() if file.suffix.lower() in suffixes and not file.name.startswith("."))
