"""Standard deviation of a detected point, in pixels, from its score and the person's size."""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import BODY, FACE, FEET, LEFT_HAND, RIGHT_HAND
from gsac.stages.first_look import BODY_SPAN

BY_GROUP = ((BODY, 0.010), (FEET, 0.010), (FACE, 0.005), (LEFT_HAND, 0.005), (RIGHT_HAND, 0.005))
"""Standard deviation at full score, as a fraction of the person's height; measured for the embedded detectors on rendered truth."""
LEAST_SCORE = 0.1
"""Lower scores give no larger sigma."""


def person_height(xy: np.ndarray, score: np.ndarray) -> float:
    """xy: (T, 133, 2) px; score: (T, 133). Returns px, the upper quartile over the frames of the body points' extent; 0 where no
    frame shows two of them."""
    heights = []
    for points, good in zip(xy[:, BODY], score[:, BODY] > 0.3, strict=True):
        if good.sum() >= 2:
            heights.append(float(np.linalg.norm(np.ptp(points[good], axis=0))))
    return float(np.percentile(heights, 75)) / BODY_SPAN if heights else 0.0


def detection_sigma(score: np.ndarray, height: float) -> np.ndarray:
    """score: (T, 133); height: px, the person's. Returns (T, 133) px; the whole height where a point was not seen."""
    sigma = np.empty(score.shape, np.float64)
    for group, fraction in BY_GROUP:
        sigma[:, group] = fraction * height / np.maximum(score[:, group], LEAST_SCORE)
    return np.maximum(np.where(score > 0, sigma, max(height, 1.0)), 0.5)
