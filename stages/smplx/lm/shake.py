"""Spread of the acceleration of transl: wider where the trunk's points say that the camera shakes or the person dances.

A held camera moves the person by centimetres from frame to frame. A stiff prior on transl would lay that into the pose.
"""

from __future__ import annotations

import numpy as np

from gsac.stages.smplx import prior
from gsac.stages.smplx.sightings import TRUNK, Sightings

USUAL = 4.0
"""Factor on the prior's spread up to which accelerations are those of a person who turns on the spot."""
NOISE = 0.012
"""Second difference of the trunk's middle, as a share of the person's height, up to which it may be the detector's noise."""
METRES = 1.7
"""A person's height, to tell accelerations in metres before anything is fitted."""
SIGMA = 0.6745
"""Median of the absolute value of a normal variable, in standard deviations."""


def transl_acceleration(sightings: Sightings) -> np.ndarray:
    """(3,) m/s^2, spread of the acceleration of transl: the prior's, or across the picture what the trunk's points move."""
    out = np.full(3, prior.TRANSL_ACCELERATION)
    seen = np.all(sightings.seen[:, TRUNK], axis=1)
    known = seen[:-2] & seen[1:-1] & seen[2:]
    if sightings.seconds is None or not known.any():
        return out
    gap = np.diff(sightings.seconds)[:, None]
    middle = sightings.xy[:, TRUNK].mean(1) / sightings.person_height
    moved, span = np.diff(middle, axis=0), 0.5 * (gap[1:] + gap[:-1])
    jump = np.median(np.abs(np.diff(moved, axis=0)[known]), 0) / SIGMA
    acceleration = METRES * np.median(np.abs((np.diff(moved / gap, axis=0) / span)[known]), 0) / SIGMA
    if (jump > NOISE).any() and (acceleration > USUAL * out[:2]).any():
        out[:2] = np.maximum(out[:2], acceleration)
    return out
