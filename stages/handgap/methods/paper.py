"""A segment through a gap turns at a constant rate in the image (GSAC eq. 1-10, read so that they agree).

The relative angles of the paper's chain add up to each segment's own angle. It goes from the last seen frame t-n to the first
seen frame t along the shorter arc; the length stays that of t-n.
"""

from __future__ import annotations

import numpy as np


def interpolate(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, a joint less its parent; seen: (T,) bool; times: (T,) s.

    Returns the segment (after - before - 1, 2) px in the frames between the seen frames `before` and `after`.
    """
    start, end = segment[before], segment[after]
    angle = np.arctan2(start[1], start[0])
    turn = np.arctan2(end[1], end[0]) - angle
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    rate = turn / (times[after] - times[before])
    angles = angle + rate * (times[before + 1: after] - times[before])
    return np.hypot(*start) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
