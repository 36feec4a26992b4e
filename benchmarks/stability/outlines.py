"""Faults of masks: too wide, too narrow, with holes, late, without a part, or empty."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from gsac.benchmarks.stability.fault import Fault, Origin, pick_some

Touched = tuple[np.ndarray, np.ndarray]
"""The masks (T, H, W) float32, and the frames (T,) bool that were touched."""


def widen(alpha: np.ndarray, px: float, rng: np.random.Generator) -> Touched:
    """px: at the rim, of a clip 1280 px high. alpha: (T, H, W)."""
    return _each(alpha, lambda a: cv2.dilate(a, _disc(a, px)))


def narrow(alpha: np.ndarray, px: float, rng: np.random.Generator) -> Touched:
    """px: at the rim, of a clip 1280 px high. alpha: (T, H, W)."""
    return _each(alpha, lambda a: cv2.erode(a, _disc(a, px)))


def pierce(alpha: np.ndarray, share: float, rng: np.random.Generator) -> Touched:
    """share: of the person's area that is missing in round holes. alpha: (T, H, W)."""
    def holes(a: np.ndarray) -> np.ndarray:
        out, area = a.copy(), (a > 0.5).sum()
        rows, columns = np.nonzero(a > 0.5)
        radius = max(2, round(0.012 * max(a.shape)))
        for k in rng.integers(0, max(len(rows), 1), int(share * area / (np.pi * radius**2)) + 1) if len(rows) else ():
            cv2.circle(out, (int(columns[k]), int(rows[k])), radius, 0, -1)
        return out

    return _each(alpha, holes)


def delay(alpha: np.ndarray, count: float, rng: np.random.Generator) -> Touched:
    """count: frames that each mask is late. alpha: (T, H, W)."""
    late = np.maximum(np.arange(len(alpha)) - int(count), 0)
    return alpha[late], late != np.arange(len(alpha))


def drop_part(alpha: np.ndarray, share: float, rng: np.random.Generator) -> Touched:
    """share: of the person's width, from the left, that the masks leave out in every third frame. alpha: (T, H, W)."""
    out, some = alpha.copy(), pick_some(len(alpha), 1 / 3, rng)
    for t in np.flatnonzero(some):
        columns = np.flatnonzero((alpha[t] > 0.5).any(0))
        if len(columns):
            out[t, :, :int(columns[0] + share * np.ptp(columns))] = 0
    return out, some


def empty(alpha: np.ndarray, share: float, rng: np.random.Generator) -> Touched:
    """share: of the masks that are empty. alpha: (T, H, W)."""
    some = pick_some(len(alpha), share, rng)
    return np.where(some[:, None, None], np.float32(0), alpha), some


def end_early(alpha: np.ndarray, share: float, rng: np.random.Generator) -> Touched:
    """share: of the masks, the last ones, that the folder lacks. alpha: (T, H, W)."""
    return alpha[:len(alpha) - max(1, round(share * len(alpha)))], np.ones(len(alpha), bool)


def _disc(alpha: np.ndarray, px: float) -> np.ndarray:
    radius = max(1, round(px * max(alpha.shape) / 1280))
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)


def _each(alpha: np.ndarray, change: Callable[[np.ndarray], np.ndarray]) -> Touched:
    return np.stack([change(a) for a in alpha]), np.ones(len(alpha), bool)


FAULTS = (
    Fault("mask-wide", "px at the rim, of a clip 1280 px high", (2, 4, 8, 16, 32), widen, Origin.ALPHA),
    Fault("mask-narrow", "px at the rim, of a clip 1280 px high", (2, 4, 8, 12, 16), narrow, Origin.ALPHA),
    Fault("mask-holes", "share of the person's area", (0.01, 0.03, 0.06, 0.1, 0.2), pierce, Origin.ALPHA),
    Fault("mask-late", "frames", (1, 2, 3, 4, 6), delay, Origin.ALPHA),
    Fault("mask-part-missing", "share of the width, in every third frame", (0.1, 0.2, 0.3, 0.45, 0.6), drop_part, Origin.ALPHA),
    Fault("mask-empty", "share of masks", (0.1, 0.3, 0.6, 0.9, 1.0), empty, Origin.ALPHA),
    Fault("masks-missing", "share of masks that the folder lacks", (0.05, 0.2, 0.5, 0.9, 1.0), end_early, Origin.ALPHA),
)
