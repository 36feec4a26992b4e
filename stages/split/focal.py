"""Focal length in pixels from what cameras write into their files."""

from __future__ import annotations

import math
from collections.abc import Mapping

FILM_DIAGONAL_MM = math.hypot(36, 24)
APPLE_KEY = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
EXIF_IFD, FOCAL_35MM = 0x8769, 0xA405


def from_35mm(equivalent_mm: float, width: int, height: int) -> float:
    """Pixels, from a 35 mm equivalent, which by CIPA DCG-001 compares the diagonals of film and image."""
    return equivalent_mm / FILM_DIAGONAL_MM * math.hypot(width, height)


def from_exif(exif, width: int, height: int) -> float | None:
    """exif: PIL.Image.Exif; width, height: px of the picture it belongs to."""
    return _from_text(exif.get_ifd(EXIF_IFD).get(FOCAL_35MM), width, height)


def from_video_tags(tags: Mapping[str, str], width: int, height: int) -> float | None:
    """tags: container and stream metadata of a video."""
    return _from_text(tags.get(APPLE_KEY), width, height)


def _from_text(value, width: int, height: int) -> float | None:
    try:
        equivalent = float(value)
    except (TypeError, ValueError):
        return None
    # Writers put 0 for "unknown".
    return from_35mm(equivalent, width, height) if equivalent > 0 else None
