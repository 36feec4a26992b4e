"""The frames that a gap is filled from, where all of a long clip's would take too long."""

from __future__ import annotations

import numpy as np

NEAR_S = 1.5
"""Frames within so many seconds of a gap are all used."""


def pick_frames(known: np.ndarray, asked: np.ndarray, times: np.ndarray, most: int) -> np.ndarray:
    """(K,) rising indices of the known frames to learn from: all, or of more than `most` those near a gap and every n-th other.

    known, asked: (T,) bool; times: (T,) s. Where many are near, K is larger than `most`.
    """
    frames = np.flatnonzero(known)
    if len(frames) <= most:
        return frames
    near = np.abs(times[frames][:, None] - times[asked]).min(1) <= NEAR_S
    room = max(most - near.sum(), most // 4)
    stride = max(1, int(np.ceil((~near).sum() / room)))
    return np.sort(np.concatenate([frames[near], frames[~near][::stride]]))
