"""How far the body has turned in each frame, from points that no arm hides.

A point fixed to a turning body moves sideways as a sum of the cosine and the sine of the turn. The 3D points of the detector
say the turn to about 5 degrees a frame; regressed onto where torso, head and feet lie in the image, and smoothed, it is
known to 1 degree from frame to frame. Without 3D points the two strongest sideways motions of the body stand for cosine and
sine. Only differences of the turn matter here: its zero and its sign are free.
"""

from __future__ import annotations

import itertools

import numpy as np

from gsac.avatar.wholebody import INDEX

TORSO = [INDEX[f"{side}_{part}"] for part in ("shoulder", "hip") for side in ("left", "right")]
BODY_FIXED = [INDEX[name] for name in ("nose", "left_eye", "right_eye", "left_ear", "right_ear")] + TORSO + [
    INDEX[f"{side}_{part}"] for part in ("knee", "ankle", "big_toe", "heel") for side in ("left", "right")]
SEEN_SCORE, SEEN_SHARE = 0.3, 0.9
RIDGE = 0.01
"""Torso lengths, squared: keeps the detector's noise out of the regression."""
FULL_ENOUGH = np.radians(270)
"""Without 3D points the turn is only read where the clip shows at least this much of it."""
SMOOTH_S, SMOOTH_NOISE, WANDER = (0.2, 0.35, 0.6, 1.0), (0.01, 0.02, 0.04, 0.08), (0.2,)
"""Grid of time constants (s) and noise (rad) for the turn about its straight line, and its spread (rad)."""
SHAKES, DRIFTS = (0.002, 0.004, 0.008, 0.016), (0.05, 0.3)
"""The same for the body's centre, torso lengths."""
JUMP = 5.0
"""Times the usual shaking."""


def body_centre(xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """(T, 2) px: middle of those shoulders and hips that the clip shows; a point unseen for a while is bridged in time."""
    seen = score[:, TORSO] > SEEN_SCORE
    kept = [i for i in range(len(TORSO)) if seen[:, i].mean() >= SEEN_SHARE] or [int(seen.sum(0).argmax())]
    frames = np.arange(len(xy))
    points = []
    for i in kept:
        track, at = xy[:, TORSO[i]], frames[seen[:, i]]
        points.append(np.stack([np.interp(frames, at, track[at, c]) if len(at) else track[:, c] for c in range(2)], 1))
    return np.mean(points, 0)


def body_turn(xy: np.ndarray, score: np.ndarray, world: np.ndarray, times: np.ndarray, torso: float) -> np.ndarray:
    """xy: (T, 133, 2) px; world: (T, 133, 3) m, NaN or zero where unknown; torso: px.

    Returns (T,) rad, unwrapped; zeros where the turn cannot be told.
    """
    points = [p for p in BODY_FIXED if (score[:, p] > SEEN_SCORE).mean() >= SEEN_SHARE]
    if len(points) < 3 or len(xy) < 6 or not np.isfinite(torso):
        return np.zeros(len(xy))
    sideways = (xy[:, points, 0] - body_centre(xy, score)[:, None, 0]) / torso
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
    return smoothed(np.unwrap(np.arctan2(sine, cosine)), times)


def settled(centre: np.ndarray, times: np.ndarray, torso: float) -> np.ndarray:
    """(T, 2) px of the body's centre without the detector's shaking: a filled arm hangs from it. Frames that leave the smooth way
    by far more than others did move, and stay."""
    if len(times) < 3:
        return centre
    calm = np.stack([smoothed(c / torso, times, DRIFTS, SHAKES) for c in centre.T], 1) * torso
    off = np.linalg.norm(centre - calm, axis=1)
    return np.where((off > JUMP * max(np.median(off), SHAKES[0] * torso))[:, None], centre, calm)


def smoothed(angle: np.ndarray, times: np.ndarray, wanders: tuple = WANDER, noises: tuple = SMOOTH_NOISE) -> np.ndarray:
    """(T,) a straight line and a Gaussian process about it, its time constant and noise the likeliest of a grid."""
    line = np.polyval(np.polyfit(times, angle, 1), times)
    rest = angle - line
    best = None
    for wander, length, noise in itertools.product(wanders, SMOOTH_S, noises):
        kernel = wander**2 * np.exp(-0.5 * ((times[:, None] - times) / length) ** 2)
        factor = np.linalg.cholesky(kernel + noise**2 * np.eye(len(times)))
        white = np.linalg.solve(factor, rest)
        evidence = -0.5 * white @ white - np.log(np.diag(factor)).sum()
        if best is None or evidence > best[0]:
            best = (evidence, kernel @ np.linalg.solve(factor.T, white))
    return line + best[1]
