"""Which frames show a person, by their points."""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import BODY

SURE, LEAST = 0.2, 4
"""Score of a body point that counts, and how many show a person."""


def find_seen(score: np.ndarray, filled: np.ndarray | None = None) -> np.ndarray:
    """(T,) bool, frames with four body points, one of which was detected: filled hands alone are nobody.

    score: (T, 133); filled: (T, 133) bool, None: nothing was.
    """
    found = score[:, BODY] > SURE
    detected = found if filled is None else found & ~filled[:, BODY].astype(bool)
    return (found.sum(1) >= LEAST) & detected.any(1)
