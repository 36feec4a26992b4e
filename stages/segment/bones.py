"""The bones that the points draw: what lies on one is the person, however much it looks like the scene."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from gsac.avatar.wholebody import INDEX

CHAINS = ("left_wrist left_elbow left_shoulder left_hip left_knee left_ankle",
          "right_wrist right_elbow right_shoulder right_hip right_knee right_ankle",
          "left_shoulder right_shoulder left_hip right_hip left_shoulder")
"""Points that bones join, one to the next: both sides, and across the trunk."""
BONES = tuple(pair for chain in CHAINS for pair in pairwise(INDEX[name] for name in chain.split()))
SEEN = 0.3
"""Least score of both points of a bone."""


def distance_to_bones(shape: tuple[int, int], xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """(H, W) float32 px, from each pixel to the nearest bone; infinite where no bone is seen. shape: H, W; xy: (133, 2) px; score:
    (133,)."""
    if not any(score[list(ends)].min() > SEEN for ends in BONES):
        return np.full(shape, np.inf, np.float32)
    apart = np.ones(shape, np.uint8)
    for ends in BONES:
        if score[list(ends)].min() > SEEN:
            first, last = xy[list(ends)].round().astype(int).tolist()
            cv2.line(apart, first, last, 0)
    return cv2.distanceTransform(apart, cv2.DIST_L2, 5)
