"""Frames in which the detector took the person's left for the right.

It then sees a back as a front: the turn jumps by half a circle, and back. The turn alone proposes such frames; that the points with
left and right exchanged fit one body in one motion better than as they were found decides.
"""

from __future__ import annotations

import numpy as np

from gsac.stages.smplx.initial import TRUNK
from gsac.stages.smplx.sightings import Sightings

JUMP = np.radians(60)
"""Cost of a change between right and swapped, in turn: people who turn fast on film with few frames turn by 45 degrees a frame."""
UNLIKELY = np.radians(0.5)
"""Cost of a swapped frame: of two halves that contradict each other the longer one is right."""
MARGIN = 20.0
"""By how much the fit's cost must fall for each exchanged frame. It falls by 29 to 104 where sides were swapped, of three rendered
people at 20 frames, and rises by 79 where pictures are out of order."""


def propose_swapped(sightings: Sightings) -> np.ndarray:
    """(T,) bool: frames whose left and right are swapped if the turn from frame to frame is the least (Viterbi); none of photos."""
    out = np.zeros(len(sightings.xy), bool)
    world = sightings.world.astype(np.float64)
    across = world[:, TRUNK[0]] - world[:, TRUNK[1]] + world[:, TRUNK[2]] - world[:, TRUNK[3]]
    frames = np.flatnonzero(np.isfinite(across).all(1) & sightings.seen[:, TRUNK].all(1))
    if len(frames) < 3 or sightings.seconds is None:
        return out
    angle = np.arctan2(across[frames, 2], across[frames, 0])
    step = np.abs(np.angle(np.exp(1j * np.diff(angle))))
    cost, came = np.array([0, UNLIKELY]), np.zeros((len(frames), 2), int)
    for t, (same, other) in enumerate(zip(step, np.pi - step + JUMP, strict=True), 1):
        ways = cost + np.array([[same, other], [other, same]])  # to, from
        came[t], cost = ways.argmin(1), ways.min(1) + (0, UNLIKELY)
    swapped = int(cost.argmin())
    for t in range(len(frames) - 1, -1, -1):
        out[frames[t]], swapped = bool(swapped), came[t, swapped]
    return out
