"""A mask that a user brings: a PNG or EXR, white where the person is."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

LEAST_SHOWN = 0.5
"""A mask without a pixel of so much alpha shows nobody, one with no pixel of less tells nobody from the scene."""
NEARLY = 0.01
"""By how much an EXR's alpha may leave 0..1, as resampling makes it, and the colours of a grey picture may differ."""
SAME_ASPECT = 0.01
"""Difference of two aspects that rounding makes."""


class MaskError(ValueError):
    """A file is no mask, or none of its frame. The message names it and what was expected."""


def read_mask(path: Path) -> np.ndarray:
    """(H, W) float32 in 0..1. MaskError where the file is no mask, or shows nobody or nothing else."""
    name = f"{path.parent.name}/{path.name}"
    try:
        pixels = _read_exr(path) if path.suffix.lower() == ".exr" else _read_picture(path)
    except Exception as e:  # a damaged file makes the readers raise nearly anything
        raise MaskError(f"{name}: cannot be read as an image ({e or type(e).__name__}); export it again") from e
    mask = _of_one(pixels)
    if mask is None:
        raise MaskError(f"{name}: is coloured; expected a grey picture, white where the person is and black elsewhere")
    if not (np.isfinite(mask).all() and mask.min() >= -NEARLY and mask.max() <= 1 + NEARLY):
        raise MaskError(f"{name}: has values from {mask.min():g} to {mask.max():g}; expected 0 to 1")
    if mask.max() < LEAST_SHOWN:
        raise MaskError(f"{name}: is empty, no pixel of it is white; expected the person in white, or cut the clip where nobody is")
    if mask.min() >= LEAST_SHOWN:
        raise MaskError(f"{name}: is white all over; expected the person in white and all else in black")
    return np.clip(mask, 0, 1)


def scale_mask(mask: np.ndarray, width: int, height: int, path: Path) -> np.ndarray:
    """mask: (H, W). Returns (height, width), px; path: that it was read from. MaskError where its aspect is another."""
    high, wide = mask.shape
    if abs(wide / high * height / width - 1) >= SAME_ASPECT:
        raise MaskError(f"{path.parent.name}/{path.name}: is {wide}x{high} px, of another aspect than its frame, which is "
                        f"{width}x{height} as shown; expected the same, upright and whole")
    return resize_mask(mask, width, height)


def resize_mask(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    """mask: (H, W). Returns (height, width), px; smaller ones are means."""
    if mask.shape == (height, width):
        return mask
    return cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA if mask.shape[0] > height else cv2.INTER_LINEAR)


def _read_exr(path: Path) -> np.ndarray:
    import OpenEXR

    with path.open("rb") as stream, OpenEXR.File(stream) as file:
        channels = file.channels()
        return np.array(channels["A" if "A" in channels else next(iter(channels))].pixels, np.float32)


def _read_picture(path: Path) -> np.ndarray:
    pixels = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("its content is no picture")
    # Some write 0 and 1 where 0 and 255 are meant.
    most = 1 if pixels.max() <= 1 else 255 if pixels.dtype == np.uint8 else 65535
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
