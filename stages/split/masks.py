"""Masks that the user brings: a folder `masks` beside the footage, one picture a frame, white where the person is.

A mask is named after its photo (`masks/IMG_7.png` of `IMG_7.jpg`), or by the number of the video's frame, counted from 0
(`masks/000007.png`). It stands upright as the footage is shown and has its aspect, at any size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from PIL import ImageOps

from gsac.avatar.artifacts import Crop, write_alpha
from gsac.stages.contract import BadInput
from gsac.stages.split.film import MASKS
from gsac.stages.split.photos import SAME_ASPECT, open_image

SUFFIXES = (".png", ".exr")
LEAST_SHOWN = 0.5
"""A mask without a pixel of so much alpha shows nobody."""
NEARLY = 0.01
"""By how much an EXR's alpha may leave 0..1, as resampling makes it, and colours of a grey picture may differ."""

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
    return lambda photo, width, height: scale_mask(read_mask(file_of[photo]), width, height, file_of[photo])


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


def read_mask(path: Path) -> np.ndarray:
    """(H, W) float32 in 0..1. BadInput where the file is no mask, or shows nobody."""
    name = f"{MASKS}/{path.name}"
    try:
        pixels = _read_exr(path) if path.suffix.lower() == ".exr" else _read_picture(path)
    except BadInput as e:
        raise BadInput(f"{MASKS}/{e}") from e
    except Exception as e:  # a damaged file makes the readers raise nearly anything
        raise BadInput(f"{name}: cannot be read as an image ({e or type(e).__name__}); export it again") from e
    mask = _of_one(pixels)
    if mask is None:
        raise BadInput(f"{name}: is coloured; expected a grey picture, white where the person is and black elsewhere")
    if not (np.isfinite(mask).all() and mask.min() >= -NEARLY and mask.max() <= 1 + NEARLY):
        raise BadInput(f"{name}: has values from {mask.min():g} to {mask.max():g}; expected 0 to 1")
    if mask.max() < LEAST_SHOWN:
        raise BadInput(f"{name}: is empty, no pixel of it is white; expected the person in white, or cut the clip where nobody is")
    return np.clip(mask, 0, 1)


def scale_mask(mask: np.ndarray, width: int, height: int, path: Path) -> np.ndarray:
    """mask: (H, W). Returns (height, width), px; path: that it was read from. BadInput where its aspect is another."""
    high, wide = mask.shape
    if abs(wide / high * height / width - 1) >= SAME_ASPECT:
        raise BadInput(f"{MASKS}/{path.name}: is {wide}x{high} px, of another aspect than its frame, which is {width}x{height} as "
                       "shown; expected the same, upright and whole")
    return _resize(mask, width, height)


def write_masks(frames: Path, files: list[Path], footage: tuple[int, int], crop: Crop | None, size: tuple[int, int],
                turned: np.ndarray) -> None:
    """Writes masks/%06d.exr as the frames of a video are made. footage, size: width and height of the video and of the frames, px;
    turned: (T,) bool, frames that were mirrored and turned back."""
    (frames / MASKS).mkdir()
    for t, path in enumerate(files):
        mask = read_mask(path)
        if crop is None:
            mask = scale_mask(mask, *size, path)
        else:
            mask = scale_mask(mask, *footage, path)[crop.y: crop.y + crop.height, crop.x: crop.x + crop.width]
        write_alpha(frames / MASKS / f"{t:06d}.exr", _resize(mask[:, ::-1] if turned[t] else mask, *size))


def _read_exr(path: Path) -> np.ndarray:
    import OpenEXR

    with path.open("rb") as stream, OpenEXR.File(stream) as file:
        channels = file.channels()
        return np.array(channels["A" if "A" in channels else next(iter(channels))].pixels, np.float32)


def _read_picture(path: Path) -> np.ndarray:
    with open_image(path) as image:
        image.load()
        upright = ImageOps.exif_transpose(image)
    if upright.mode in ("P", "PA"):
        upright = upright.convert("RGBA" if upright.has_transparency_data else "RGB")
    pixels = np.asarray(upright)
    # Some write 0 and 1 where 0 and 255 are meant.
    most = 1 if pixels.dtype == bool or pixels.max() <= 1 else 255 if pixels.dtype == np.uint8 else 65535
    return pixels.astype(np.float32) / most


def _of_one(pixels: np.ndarray) -> np.ndarray | None:
    """pixels: (H, W) or (H, W, C). Returns (H, W): the transparency where it varies, else the grey; None of colours."""
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] in (2, 4):
        if np.ptp(pixels[..., -1]) > 0:
            return pixels[..., -1]
        pixels = pixels[..., :-1]
    return pixels[..., 0] if np.ptp(pixels, axis=2).max() <= NEARLY else None


def _resize(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    import cv2

    if mask.shape == (height, width):
        return mask
    smaller = mask.shape[0] > height
    return cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
