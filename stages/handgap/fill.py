"""Fills the arms through their gaps by the chosen method."""

from __future__ import annotations

import numpy as np

from gsac.stages.handgap import arm_gp, segments, turning_body
from gsac.stages.handgap.missing_hands import SIDES, Found, torso_length


def fill_gaps(xy: np.ndarray, score: np.ndarray, world: np.ndarray, found: Found, times: np.ndarray, config,
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """xy: (T, 133, 2) px; score: (T, 133); world: (T, 133, 3) m or NaN; times: (T,) s.

    Returns xy with the gaps filled, filled (T, 133) bool, and drift (T, 133) px: standard deviation along each axis of
    the truth about the filled point, over that of a detection.
    """
    xy, filled = xy.copy(), np.zeros(xy.shape[:2], bool)
    drift = np.zeros(filled.shape)
    body = turning_body.watch(xy, score, world, times, torso_length(xy, score)) if config.method == "turning" else None
    for i, side in enumerate(SIDES):
        hand = found.hand[:, i]
        lost = np.stack([hand & found.elbow[:, i], hand & found.wrist[:, i], hand])
        if not hand.any():
            continue
        if body:
            unsure = np.stack([found.elbow[:, i], found.wrist[:, i], hand])
            arm_gp.fill_arm(xy, filled, drift, side, lost, unsure, body, config)
        else:
            segments.fill_arm(xy, filled, drift, side, lost, times, config)
    return xy, filled, drift
