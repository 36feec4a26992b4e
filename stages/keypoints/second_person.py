"""Which of several persons is followed, in words that tell them apart in the picture."""

from __future__ import annotations

import numpy as np

from gsac.stages.keypoints.detection import Frame

MOSTLY = 0.9
"""Share of the sightings of somebody else in which a word must be true of the followed person."""
LARGER = 1.15
"""Ratio of two persons' sizes in the picture from which on a viewer sees it."""


def name_followed(frames: list[Frame]) -> str:
    """The person who is followed, as told from those beside them: by side, else by size, else without saying which."""
    pairs = [(frame.region, other) for frame in frames if frame.region is not None for other in frame.others]
    right = np.array([own.center[0] - other.center[0] for own, other in pairs])
    ratio = np.array([own.side / other.side for own, other in pairs])
    words = {"the one on the left in the picture": right < 0, "the one on the right in the picture": right > 0,
             "the larger one": ratio > LARGER, "the smaller one": ratio < 1 / LARGER}
    return next((word for word, true in words.items() if len(pairs) and true.mean() >= MOSTLY), "only one of them")
