"""Cubic Hermite curve through a gap, its end speeds from a straight line through the seen frames beside it."""

from __future__ import annotations

import numpy as np

LINE_FRAMES = 6


def fill(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, joint minus its parent; returns (after - before - 1, 2) for the frames between."""
    p0, v0 = _end(segment, seen, times, np.arange(before, max(before - LINE_FRAMES, -1), -1))
    p1, v1 = _end(segment, seen, times, np.arange(after, min(after + LINE_FRAMES, len(times))))
    span = times[after] - times[before]
    u = ((times[before + 1: after] - times[before]) / span)[:, None]
    return ((1 + 2 * u) * (1 - u) ** 2 * p0 + u * (1 - u) ** 2 * span * v0
            + u ** 2 * (3 - 2 * u) * p1 + u ** 2 * (u - 1) * span * v1)


def _end(segment, seen, times, frames) -> tuple[np.ndarray, np.ndarray]:
    """Position at frames[0] and velocity (px/s): least squares over unbroken seen frames, zero from fewer than 3."""
    broken = np.flatnonzero(~seen[frames])
    frames = frames[: broken[0]] if len(broken) else frames
    position = segment[frames[0]]
    if len(frames) < 3:
        return position, np.zeros(2)
    t = times[frames] - times[frames].mean()
    return position, t @ segment[frames] / (t @ t)
