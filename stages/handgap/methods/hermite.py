"""A segment through a gap as a cubic Hermite curve; the speed at each end is that of a line fitted to the seen frames there."""

from __future__ import annotations

import numpy as np

LINE_FRAMES = 6
"""Seen frames that the line is fitted to, at most."""


def interpolate(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, a joint less its parent; seen: (T,) bool; times: (T,) s.

    Returns the segment (after - before - 1, 2) px in the frames between the seen frames `before` and `after`.
    """
    p0, v0 = _end(segment, seen, times, np.arange(before, max(before - LINE_FRAMES, -1), -1))
    p1, v1 = _end(segment, seen, times, np.arange(after, min(after + LINE_FRAMES, len(times))))
    span = times[after] - times[before]
    u = ((times[before + 1: after] - times[before]) / span)[:, None]
    return ((1 + 2 * u) * (1 - u) ** 2 * p0 + u * (1 - u) ** 2 * span * v0
            + u ** 2 * (3 - 2 * u) * p1 + u ** 2 * (u - 1) * span * v1)


def _end(segment: np.ndarray, seen: np.ndarray, times: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place (2,) px at frames[0] and velocity (2,) px/s: least squares over frames seen without a break, 0 from fewer than 3."""
    broken = np.flatnonzero(~seen[frames])
    frames = frames[: broken[0]] if len(broken) else frames
    position = segment[frames[0]]
    if len(frames) < 3:
        return position, np.zeros(2)
    t = times[frames] - times[frames].mean()
    return position, t @ segment[frames] / (t @ t)
