"""A segment through a gap as a Gaussian process in the image: squared exponential kernel, over the seen frames around the gap.

Of a small grid of kernel lengths, amplitudes and noises it takes those that make the seen frames likeliest.
"""

from __future__ import annotations

import itertools

import numpy as np

LENGTHS_FRAMES = (3.5, 5.0, 7.0, 10.0, 14.0, 20.0, 28.0)
"""Grid of the kernel's length."""
NOISE_SHARES = (1.0, 0.5, 0.25)
"""Grid of factors on the noise read from second differences: fast motion makes that too large."""
SWELLS = (1.0, 3.0)
"""Grid of factors on the amplitude of the seen frames: a slow motion seen for a short time makes that too small."""
REACH_FRAMES = 40
"""Farthest seen frames, before and after the gap, that are learned from."""
LEAST_NOISE_PX = 0.3


def interpolate(segment: np.ndarray, seen: np.ndarray, before: int, after: int, times: np.ndarray) -> np.ndarray:
    """segment: (T, 2) px, a joint less its parent; seen: (T,) bool; times: (T,) s.

    Returns the segment (after - before - 1, 2) px in the frames between the seen frames `before` and `after`.
    """
    asked = times[before + 1: after]
    known = np.flatnonzero(seen)
    known = known[(known >= before - REACH_FRAMES) & (known <= after + REACH_FRAMES)]
    at, values = times[known], segment[known]
    mean = values.mean(axis=0)
    rough = max(noise_px(segment, seen), LEAST_NOISE_PX)
    # A floor well above the noise, or a still arm would give an ill-posed system.
    amplitude = max(float(values.std(axis=0).max()), 4 * rough)
    frame = float(np.median(np.diff(times)))
    best = None
    for length, share, swell in itertools.product(LENGTHS_FRAMES, NOISE_SHARES, SWELLS):
        kernel = (swell * amplitude) ** 2 * _kernel(at, at, length * frame)
        noise = max(share * rough, LEAST_NOISE_PX)
        factor = np.linalg.cholesky(kernel + noise**2 * np.eye(len(known)))
        weights = np.linalg.solve(factor.T, np.linalg.solve(factor, values - mean))
        evidence = -0.5 * ((values - mean) * weights).sum() - 2 * np.log(np.diag(factor)).sum()
        if best is None or evidence > best[0]:
            best = (evidence, length, (swell * amplitude) ** 2 * weights)
    _, length, weights = best
    return mean + _kernel(asked, at, length * frame) @ weights


def noise_px(segment: np.ndarray, seen: np.ndarray) -> float:
    """segment: (T, 2) px; seen: (T,) bool. Returns the noise of one coordinate, in the segment's unit, robust.

    From second differences over three seen frames in a row, whose variance is 6 times that of one point.
    """
    triples = seen[:-2] & seen[1:-1] & seen[2:]
    if not triples.any():
        return 0.0
    bend = (segment[:-2] - 2 * segment[1:-1] + segment[2:])[triples]
    return float(1.4826 * np.median(np.abs(bend)) / np.sqrt(6))


def _kernel(a: np.ndarray, b: np.ndarray, length: float) -> np.ndarray:
    return np.exp(-0.5 * ((a[:, None] - b[None]) / length) ** 2)
