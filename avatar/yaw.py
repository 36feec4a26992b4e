"""Yaw: which way a body or a head faces in the camera frame, and how much of a turn a clip's frames show."""

from __future__ import annotations

import numpy as np


def yaw_of(front: np.ndarray) -> np.ndarray:
    """front: (..., 3), any length, where a body or a head faces, camera frame. Returns (...) rad: 0 toward the camera, growing
    to the frame's right, which is the person's left."""
    return np.arctan2(front[..., 0], -front[..., 2])


def yaw(turns: np.ndarray) -> np.ndarray:
    """turns: (..., 3, 3) rotations of a body from its own axes (z front) to the camera frame. Returns (...) rad as `yaw_of`."""
    return yaw_of(turns[..., 2])


def turn_seen(turns: np.ndarray) -> float:
    """turns: (T, 3, 3) as in `yaw`. How many of the 360 degrees of yaw the frames cover, as `degrees_covered`."""
    return degrees_covered(yaw(turns))


def degrees_covered(yaws: np.ndarray) -> float:
    """yaws: (T,) rad. How many of 360 degrees they cover: all but the widest gap between them."""
    at = np.sort(np.degrees(yaws) % 360)
    return max(0.0, 360 - float(np.diff(at, append=at[0] + 360).max())) if len(at) else 0.0  # one's gap may round above 360


def name_side(yaw: float) -> str:
    """The side of a body that the camera sees, in words: front, right side, back, left side. yaw: rad, as `yaw` gives it."""
    return ("front", "right side", "back", "left side")[round(yaw / (np.pi / 2)) % 4]
