"""Fills the arms through their gaps by the chosen method."""

from __future__ import annotations

from functools import partial

import numpy as np

from gsac.stages.handgap.arm_segments import fill_by_segments
from gsac.stages.handgap.config import HandgapConfig, Method
from gsac.stages.handgap.method import Detections, FillArm, Filled, HiddenArm
from gsac.stages.handgap.methods import gp, hermite, paper, paper_literal, turning
from gsac.stages.handgap.missing_hands import SIDES, MissingHands

METHODS: dict[Method, FillArm] = {
    "turning": turning.fill_arm,
    "gp": partial(fill_by_segments, gp.interpolate),
    "hermite": partial(fill_by_segments, hermite.interpolate),
    "paper": partial(fill_by_segments, paper.interpolate),
    "paper-literal": partial(fill_by_segments, paper_literal.interpolate),
}
"""handgap.method -> the function that fills an arm; `none` has no arm to fill."""


def fill_gaps(xy: np.ndarray, score: np.ndarray, world: np.ndarray, found: MissingHands, times: np.ndarray, config: HandgapConfig,
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """xy: (T, 133, 2) px; score: (T, 133); world: (T, 133, 3) m or NaN; times: (T,) s.

    Returns xy with the gaps filled, filled (T, 133) bool, and drift (T, 133) px: the standard deviation of a filled point along
    each axis, on top of a detection's own.
    """
    out = Filled(xy.copy(), np.zeros(xy.shape[:2], bool), np.zeros(xy.shape[:2]))
    detections = Detections(xy, score, world, times)
    for i, side in enumerate(SIDES):
        hand, wrist, elbow = found.hand[:, i], found.wrist[:, i], found.elbow[:, i]
        if hand.any():
            arm = HiddenArm(side, lost=np.stack([hand & elbow, hand & wrist, hand]), unsure=np.stack([elbow, wrist, hand]))
            METHODS[config.method](out, arm, detections, config)
    return out.xy, out.filled, out.drift
