"""A segment through a gap by GSAC eq. 5-10 exactly as printed; kept to compare `paper` with.

DeltaT (frames since t-n) multiplies the rate, although the base is the previous frame's angle: in frame k the turn is
k (k + 1) / 2 times the rate and overshoots. The difference of angles is not brought to the shorter arc.
"""

from __future__ import annotations

import numpy as np


def interpolate(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, a joint less its parent; seen: (T,) bool; times: (T,) s.

    Returns the segment (after - before - 1, 2) px in the frames between the seen frames `before` and `after`.
    """
    start, end = segment[before], segment[after]
    angle = np.arctan2(start[1], start[0])
    rate = (np.arctan2(end[1], end[0]) - angle) / (after - before)
    elapsed = np.arange(1, after - before)
    angles = angle + rate * np.cumsum(elapsed)
    return np.hypot(*start) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
