"""Moments at which the turn jumps: pictures out of order, cuts, a body that whirls.

There the smoothness of the motion says nothing, and would spoil the frames on both sides; each picture alone is as good as ever.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation

JUMP = np.radians(45)
"""Change of the step from frame to frame. On five clean clips of 60 frames it is 15 degrees at most, of 20 frames 40; pictures out
of order change it by twice their distance in the turn."""
WIDEST = np.radians(120)
"""A step that may as well have gone the other way round: four frames of a turn, few as they are, make steps of 90."""


def find_jumps(turns: np.ndarray) -> np.ndarray:
    """(T - 2,) bool, triples of frames in which the turn jumps. turns: (T, 3, 3) of the body to the camera frame."""
    step = rotation.log(turns[:-1].swapaxes(-1, -2) @ turns[1:])
    wide = np.linalg.norm(step, axis=-1) > WIDEST
    return (np.linalg.norm(np.diff(step, axis=0), axis=-1) > JUMP) | wide[:-1] | wide[1:]
