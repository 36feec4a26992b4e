"""Which way a body faces, and how much of a turn its frames show."""

from __future__ import annotations

import numpy as np


def yaw(turns: np.ndarray) -> np.ndarray:
    """turns: (..., 3, 3) of the body to the camera frame. (...) rad, 0 where it faces the camera, growing to its left."""
    return np.arctan2(turns[..., 0, 2], -turns[..., 2, 2])


def turn_seen(turns: np.ndarray) -> float:
    """turns: (T, 3, 3). Degrees about the upright axis, of 360, from which the frames show the body: all but the widest gap."""
    at = np.sort(np.degrees(yaw(turns)))
    return 360 - float(np.diff(at, append=at[0] + 360).max()) if len(at) else 0.0
