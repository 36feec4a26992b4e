"""The update of GSAC eq. 5-10 exactly as printed, kept to compare with.

DeltaT (frames since t-n) multiplies the rate AND the base is the previous frame's angle, so the turn grows as
k (k + 1) / 2 and overshoots; the difference of angles is not brought to the shorter arc.
"""

from __future__ import annotations

import numpy as np


def fill(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, joint minus its parent; returns (after - before - 1, 2) for the frames between."""
    start, end = segment[before], segment[after]
    angle = np.arctan2(start[1], start[0])
    rate = (np.arctan2(end[1], end[0]) - angle) / (after - before)
    elapsed = np.arange(1, after - before)
    angles = angle + rate * np.cumsum(elapsed)
    return np.hypot(*start) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
