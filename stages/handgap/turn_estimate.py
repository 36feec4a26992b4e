"""Estimates how far the body has turned in each frame, from points that no arm hides.

A point fixed to a turning body moves sideways as a sum of the cosine and the sine of the turn. The detector's 3D points give the
turn to about 5 degrees a frame; regressed on the image places of torso, head and feet, and smoothed, it is known to 1 degree
from frame to frame. Without 3D points, the two strongest sideways motions of the body stand for cosine and sine. Only differences
of the turn matter here: its zero and its sign are free.
"""

from __future__ import annotations

import itertools

import numpy as np

from gsac.avatar.wholebody import INDEX

TORSO = [INDEX[f"{side}_{part}"] for part in ("shoulder", "hip") for side in ("left", "right")]
BODY_FIXED = [INDEX[name] for name in ("nose", "left_eye", "right_eye", "left_ear", "right_ear")] + TORSO + [
    INDEX[f"{side}_{part}"] for part in ("knee", "ankle", "big_toe", "heel") for side in ("left", "right")]
SEEN_SCORE, SEEN_SHARE = 0.3, 0.9
"""Score from which on a point is seen, and the share of frames in which it must be to be used."""
RIDGE = 0.01
"""Torsos squared: regularises the regression against the detector's noise."""
FULL_ENOUGH = np.radians(270)
"""Without 3D points, a clip in which the body turns less than this gives no turn."""
SMOOTH_S, SMOOTH_NOISE, WANDER = (0.2, 0.35, 0.6, 1.0), (0.01, 0.02, 0.04, 0.08), (0.2,)
"""Grids of the turn's Gaussian process about a straight line: time constant (s), noise (rad), standard deviation (rad)."""
SHAKES, DRIFTS = (0.002, 0.004, 0.008, 0.016), (0.05, 0.3)
"""Grids of noise and standard deviation for the body's centre, in torsos."""
JUMP = 5.0
"""Multiple of the median deviation from the smooth path from which on the centre did move."""


def locate_centre(xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """xy: (T, 133, 2) px; score: (T, 133). Returns (T, 2) px: the middle of those shoulders and hips that most frames show,
    interpolated where one is not seen."""
    seen = score[:, TORSO] > SEEN_SCORE
    kept = [i for i in range(len(TORSO)) if seen[:, i].mean() >= SEEN_SHARE] or [int(seen.sum(0).argmax())]
    frames = np.arange(len(xy))
    points = []
    for i in kept:
        track, at = xy[:, TORSO[i]], frames[seen[:, i]]
        points.append(np.stack([np.interp(frames, at, track[at, c]) if len(at) else track[:, c] for c in range(2)], 1))
    return np.mean(points, 0)


def estimate_turn(xy: np.ndarray, score: np.ndarray, world: np.ndarray, times: np.ndarray, torso: float) -> np.ndarray:
    """xy: (T, 133, 2) px; score: (T, 133); world: (T, 133, 3) m, NaN or zero where unknown; times: (T,) s; torso: px.

    Returns (T,) rad, unwrapped; zeros where the turn cannot be estimated.
    """
    points = [p for p in BODY_FIXED if (score[:, p] > SEEN_SCORE).mean() >= SEEN_SHARE]
    if len(points) < 3 or len(xy) < 6 or not np.isfinite(torso):
        return np.zeros(len(xy))
    sideways = (xy[:, points, 0] - locate_centre(xy, score)[:, None, 0]) / torso
    across = world[:, TORSO[0]] - world[:, TORSO[1]] + world[:, TORSO[2]] - world[:, TORSO[3]]
    known = np.isfinite(across).all(1) & (np.abs(np.nan_to_num(across)).sum(1) > 1e-6)
    if known.mean() >= SEEN_SHARE:
        angle = np.arctan2(across[:, 2], across[:, 0])
        features = np.concatenate([np.ones((len(xy), 1)), sideways], 1)
        wanted = np.stack([np.cos(angle), np.sin(angle)], 1)[known]
        normal = features[known].T @ features[known] + RIDGE * known.sum() * np.eye(features.shape[1])
        cosine, sine = (features @ np.linalg.solve(normal, features[known].T @ wanted)).T
    else:
        modes, sizes, _ = np.linalg.svd(sideways - sideways.mean(0), full_matrices=False)
        cosine, sine = modes[:, :2].T
        if sizes[1] < 0.15 * sizes[0] or np.ptp(np.unwrap(np.arctan2(sine, cosine))) < FULL_ENOUGH:
            return np.zeros(len(xy))
    return smooth(np.unwrap(np.arctan2(sine, cosine)), times)


def smooth_centre(centre: np.ndarray, times: np.ndarray, torso: float) -> np.ndarray:
    """centre: (T, 2) px; times: (T,) s; torso: px. Returns (T, 2) px without the detector's noise: filled arms hang from it.

    A frame that lies off the smooth path by far more than others (`JUMP`) did move and is kept.
    """
    if len(times) < 3:
        return centre
    calm = np.stack([smooth(c / torso, times, DRIFTS, SHAKES) for c in centre.T], 1) * torso
    off = np.linalg.norm(centre - calm, axis=1)
    return np.where((off > JUMP * max(np.median(off), SHAKES[0] * torso))[:, None], centre, calm)


def smooth(values: np.ndarray, times: np.ndarray, wanders: tuple[float, ...] = WANDER,
           noises: tuple[float, ...] = SMOOTH_NOISE) -> np.ndarray:
    """values: (T,); times: (T,) s. Returns (T,): a line and a Gaussian process about it, the likeliest of the grid."""
    line = np.polyval(np.polyfit(times, values, 1), times)
    rest = values - line
    best = None
    for wander, length, noise in itertools.product(wanders, SMOOTH_S, noises):
        kernel = wander**2 * np.exp(-0.5 * ((times[:, None] - times) / length) ** 2)
        factor = np.linalg.cholesky(kernel + noise**2 * np.eye(len(times)))
        white = np.linalg.solve(factor, rest)
        evidence = -0.5 * white @ white - np.log(np.diag(factor)).sum()
        if best is None or evidence > best[0]:
            best = (evidence, kernel @ np.linalg.solve(factor.T, white))
    return line + best[1]
