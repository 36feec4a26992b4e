"""Persons who lie on the side in the picture: the phone was held across and the file does not say so."""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import INDEX
from gsac.stages.first_look import SEEN
from gsac.stages.keypoints.detection import Frame

SHOULDERS, HIPS = ([INDEX[f"{side}_{part}"] for side in ("left", "right")] for part in ("shoulder", "hip"))
LEVEL = np.radians(60)
"""From upright: it leans by 29 degrees in squats and 36 in a dance, and by 76 and more where a camera was held across."""
MOSTLY = 0.5
"""Share of the frames that show a trunk from which on the clip lies; who squats or bows leans in some."""


def find_lying(frames: list[Frame]) -> np.ndarray:
    """(T,) bool: frames whose trunk leans by more than LEVEL; none where most frames stand."""
    xy, score = (np.stack([getattr(frame, name) for frame in frames]) for name in ("xy", "score"))
    trunk = np.abs(xy[:, HIPS].mean(1) - xy[:, SHOULDERS].mean(1))
    seen = (score[:, SHOULDERS + HIPS] > SEEN).all(1)
    lying = seen & (trunk[:, 0] > np.tan(LEVEL) * trunk[:, 1])
    return lying & (lying.sum() > MOSTLY * seen.sum())
