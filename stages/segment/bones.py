"""The bones that the points draw: what lies on one is the person, however much it looks like the scene."""

from __future__ import annotations

import cv2
import numpy as np

BONES = ((5, 7), (7, 9), (6, 8), (8, 10), (11, 13), (13, 15), (12, 14), (14, 16),
         (5, 6), (11, 12), (5, 11), (6, 12), (5, 12), (6, 11))
"""Pairs of points: arms, legs, the trunk's sides and diagonals."""
SEEN = 0.3
"""Least score of both points of a bone."""


def distance_to_bones(shape: tuple[int, int], xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """(H, W) float32 px, from each pixel to the nearest bone; infinite where no bone is seen. shape: H, W; xy: (133, 2) px; score:
    (133,)."""
    apart = np.ones(shape, np.uint8)
    for ends in BONES:
        if score[list(ends)].min() > SEEN:
            first, last = xy[list(ends)].round().astype(int).tolist()
            cv2.line(apart, first, last, 0)
    return cv2.distanceTransform(apart, cv2.DIST_L2, 5) if not apart.all() else np.full(shape, np.inf, np.float32)
