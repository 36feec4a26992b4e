"""Whether a mask lies where its frame's points have the person: one that is inverted, or another frame's or clip's, does not."""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import BODY

SURE, LEAST = 0.5, 6
"""Score of a body point that counts, and how many tell where the person is."""
HELD = 0.5
"""Least share of them on a mask that is in its place."""


def share_held(mask: np.ndarray, xy: np.ndarray, score: np.ndarray, scale: float = 1.0) -> float:
    """The share of the sure body points that lie on the mask; NaN where the picture shows fewer than LEAST, or the mask nobody.

    mask: (h, w) bool; xy: (133, 2) px; score: (133,); scale: px that a pixel of the mask spans.
    """
    at = np.floor(np.nan_to_num(xy[BODY])[score[BODY] > SURE] / scale).astype(int)
    column, row = at[((at >= 0) & (at < mask.shape[::-1])).all(1)].T
    return float(mask[row, column].mean()) if len(row) >= LEAST and mask.any() else np.nan
