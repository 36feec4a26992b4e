"""Focal length in pixels, from the metadata that cameras write into their files."""

from __future__ import annotations

import math
from collections.abc import Mapping

from PIL import Image

FILM_DIAGONAL_MM = math.hypot(36, 24)
APPLE_KEY = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
EXIF_IFD, FOCAL_35MM = 0x8769, 0xA405


def from_35mm(equivalent_mm: float, width: float, height: float) -> float:
    """px, from a 35 mm equivalent in mm: by CIPA DCG-001 it compares the diagonals of film and image. width, height: px."""
    return equivalent_mm / FILM_DIAGONAL_MM * math.hypot(width, height)


def from_exif(exif: Image.Exif, width: float, height: float) -> float | None:
    """px; None where exif has no focal length. width, height: px of its photo."""
    return _from_text(exif.get_ifd(EXIF_IFD).get(FOCAL_35MM), width, height)


def from_video_tags(tags: Mapping[str, str], width: float, height: float) -> float | None:
    """px; None where tags, the metadata of container and stream, have no focal length. width, height: px of the video."""
    return _from_text(tags.get(APPLE_KEY), width, height)


def _from_text(value: object, width: float, height: float) -> float | None:
    try:
        equivalent = float(value)
    except (TypeError, ValueError):
        return None
    # Writers put 0 for "unknown".
    return from_35mm(equivalent, width, height) if equivalent > 0 else None
