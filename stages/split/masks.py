"""Masks that the user brings: a folder `masks` beside the footage, one picture a frame, white where the person is.

A mask is named after its photo (`masks/IMG_7.png` of `IMG_7.jpg`), or by the number of the video's frame, counted from 0
(`masks/000007.png`). It stands upright as the footage is shown and has its aspect, at any size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from gsac.avatar.artifacts import Crop
from gsac.avatar.frame_files import write_alpha
from gsac.avatar.mask_file import MaskError, read_mask, resize_mask, scale_mask
from gsac.stages.contract import BadInput
from gsac.stages.split.film import MASKS
from gsac.stages.split.pick import turn_size
from gsac.stages.split.upright import turn

SUFFIXES = (".png", ".exr")
Key = TypeVar("Key", int, str)


def list_masks(footage: Path) -> list[Path]:
    """The files of the folder of masks beside the footage; none where there is no such folder."""
    folder = footage / MASKS
    if not folder.is_dir():
        return []
    files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    other = [path.name for path in files if path.suffix.lower() not in SUFFIXES]
    if other:
        raise BadInput(f"{MASKS}/{other[0]}: is no mask; expected {' or '.join(SUFFIXES)} files only")
    if not files:
        raise BadInput(f"{MASKS}: the folder is empty; put one mask a frame into it, or remove it")
    return files


def match_photos(files: list[Path], photos: list[Path]) -> Callable[[Path, int, int], np.ndarray] | None:
    """What gives the mask (height, width) of one of these photos at that photo's width and height, px; None where no masks came."""
    if not files:
        return None
    masks = _by_name({path: path.stem for path in files}, {photo.stem for photo in photos},
                     "belongs to no photo; name it after its photo, as IMG_7.png of IMG_7.jpg")
    file_of = {photo: _take(masks, photo.stem, f"{photo.stem}.png", f"photo {photo.name}") for photo in photos}
    return lambda photo, width, height: load_mask(file_of[photo], width, height)


def match_frames(files: Sequence[Path], frames: int, picks: np.ndarray) -> dict[int, Path]:
    """The mask of each frame that is picked. frames: of the video; picks: (K,) indices."""
    number = {path: int(path.stem) if path.stem.isdecimal() else -1 for path in files}
    masks = _by_name(number, range(frames), f"is none of the video's frames; masks are named by their numbers, {0:06d}.png to "
                                            f"{frames - 1:06d}.png")
    return {int(pick): _take(masks, int(pick), f"{pick:06d}.png", f"frame {pick} of the video") for pick in picks}


def _by_name(names: dict[Path, Key], known: set[str] | range, otherwise: str) -> dict[Key, Path]:
    masks: dict[Key, Path] = {}
    for path, name in names.items():
        if name not in known:
            raise BadInput(f"{MASKS}/{path.name}: {otherwise}")
        if name in masks:
            raise BadInput(f"{MASKS}/{path.name}: {masks[name].name} has the same name; keep one of them")
        masks[name] = path
    return masks


def _take(masks: Mapping[Key, Path], name: Key, file: str, what: str) -> Path:
    if name not in masks:
        raise BadInput(f"{MASKS}/{file}: is missing, the mask of {what}; give each frame one, or remove the folder {MASKS}")
    return masks[name]


def write_masks(frames: Path, files: list[Path], footage: tuple[int, int], crop: Crop | None, size: tuple[int, int],
                turned: np.ndarray, quarters: int = 0) -> None:
    """Writes masks/%06d.exr as the frames of a video are made. footage, size: width and height of the video and of the frames, px;
    turned: (T,) bool, frames that were mirrored and turned back; quarters: by which the footage was turned (`upright`)."""
    (frames / MASKS).mkdir()
    for t, path in enumerate(files):
        mask = turn(load_mask(path, *turn_size(*(size if crop is None else footage), quarters)), quarters)
        if crop is not None:
            mask = mask[crop.y: crop.y + crop.height, crop.x: crop.x + crop.width]
        write_alpha(frames / MASKS / f"{t:06d}.exr", resize_mask(mask[:, ::-1] if turned[t] else mask, *size))


def load_mask(path: Path, width: int, height: int) -> np.ndarray:
    """(height, width) float32 in 0..1, px. BadInput where the file cannot be used."""
    try:
        return scale_mask(read_mask(path), width, height, path)
    except MaskError as e:
        raise BadInput(str(e)) from e
