"""Moments at which the turn jumps: pictures out of order, cuts, a body that whirls.

There the smoothness of the motion says nothing, and would spoil the frames on both sides; each picture alone is as good as ever.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.yaw import yaw

JUMP = np.radians(45)
"""Change of the step from frame to frame. On five clean clips of 60 frames it is 15 degrees at most, of 20 frames 40; pictures out
of order change it by twice their distance in the turn."""
WIDEST = np.radians(120)
"""A step that may as well have gone the other way round: four frames of a turn, few as they are, make steps of 90."""

AROUND, BACK = np.radians(120), np.radians(45)
"""A body is turned over that faces the camera within the second where the frames before and after, which differ by the first at
most, have its back within the second: detectors take backs for fronts. Between views farther apart nothing tells which way it
went, and other jumps there and back are pictures out of order."""
SHORT = 0.2
"""Share of the frames that may be turned over on end."""


def find_jumps(turns: np.ndarray) -> np.ndarray:
    """(T - 2,) bool, triples of frames in which the turn jumps. turns: (T, 3, 3) of the body to the camera frame."""
    step = rotation.log(turns[:-1].swapaxes(-1, -2) @ turns[1:])
    wide = np.linalg.norm(step, axis=-1) > WIDEST
    return (np.linalg.norm(np.diff(step, axis=0), axis=-1) > JUMP) | wide[:-1] | wide[1:]


def find_turned_over(turns: np.ndarray, seconds: np.ndarray | None) -> np.ndarray:
    """(T,) bool, frames that show a front between backs; none of photos.

    turns: (T, 3, 3) of the body to the camera frame; seconds: (T,), None for photos.
    """
    angle, out = yaw(turns), np.zeros(len(turns), bool)
    if seconds is None:
        return out
    for count in range(1, int(SHORT * len(turns)) + 1):
        for first in range(1, len(turns) - count):
            before, after = first - 1, first + count
            way = wrap(angle[after] - angle[before])
            share = (seconds[first:after] - seconds[before]) / (seconds[after] - seconds[before])
            between = np.abs(wrap(angle[before] + share * way))
            out[first:after] |= abs(way) < AROUND and (between > np.pi - BACK).all() and (np.abs(angle[first:after]) < BACK).all()
    return out


def wrap(angle: np.ndarray) -> np.ndarray:
    """angle (...) rad, between -pi and pi."""
    return np.angle(np.exp(1j * angle))
