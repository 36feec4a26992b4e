"""Constant rate of each segment's angle (GSAC eq. 1-10, the consistent reading).

The relative angles of the paper's chain telescope: each segment's own image angle turns at a constant rate from the
last seen frame t-n to the first seen frame t, along the shorter arc, with the length of t-n.
"""

from __future__ import annotations

import numpy as np


def fill(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, joint minus its parent; returns (after - before - 1, 2) for the frames between."""
    start, end = segment[before], segment[after]
    angle = np.arctan2(start[1], start[0])
    turn = np.arctan2(end[1], end[0]) - angle
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    rate = turn / (times[after] - times[before])
    angles = angle + rate * (times[before + 1: after] - times[before])
    return np.hypot(*start) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
