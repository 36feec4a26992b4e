"""Time as the turn tells it: who turns slowly moves slowly, and what is known of motion by the second is of faster turns."""

from __future__ import annotations

import numpy as np

from gsac.avatar.yaw import yaw_of
from gsac.stages.first_look import LEAST_TURN, LEFT, RIGHT

SLOWEST = 360 / 20
"""Degrees a second: on turns of 10 to 20 s gaps are filled and arms fitted alike, on turns of a minute they are not."""


def pace(times: np.ndarray, world: np.ndarray) -> np.ndarray:
    """times: (T,) s; world: (T, 133, 3) m of the detector, NaN or zero where unknown.

    Returns (T,) s, shortened where the person turns more slowly than SLOWEST; as they are where there is hardly a turn to go by.
    """
    across = (world[:, LEFT] - world[:, RIGHT]).sum(1)  # to the person's left
    known = np.flatnonzero(np.isfinite(across).all(1) & np.any(across != 0, 1))
    if len(known) < 2:
        return times
    x, y, z = across[known].T
    yaws = np.degrees(np.unwrap(yaw_of(np.stack([z, y, -x], 1))))
    turn, seconds = abs(yaws[-1] - yaws[0]), times[known[-1]] - times[known[0]]
    return times * min(1.0, turn / (SLOWEST * seconds)) if turn >= LEAST_TURN else times
