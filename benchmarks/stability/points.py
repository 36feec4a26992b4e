"""Faults of the detector's points: hands lost or misplaced, sides swapped, flicker, jitter, values that are no numbers."""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS, INDEX, NAMES
from gsac.benchmarks.stability.fault import Fault, Origin, pick_run, pick_some

Points = dict[str, np.ndarray]
"""Arrays of keypoints.npz, (T, 133, ...) each, by name."""
Touched = tuple[Points, np.ndarray]
"""The arrays, and the frames (T,) bool that were touched."""
OTHER_SIDE = np.array([INDEX[name.replace("left", "?").replace("right", "left").replace("?", "right")] for name in NAMES])
"""(133,) the point of the same name on the other side."""
ACROSS = 0.08
"""One-frame flicker throws points this far, as a share of the body's height."""


def hide_hand(points: Points, count: float, rng: np.random.Generator) -> Touched:
    """count: frames in which the left elbow, wrist and hand are not found. points: (T, 133, ...) by name."""
    out, some = _copy(points), pick_run(len(points["xy"]), count / len(points["xy"]), rng)
    gone = np.ix_(some, np.array([*range(133)[HANDS["left"]], *ARM["left"][1:3]]))
    out["xy"][gone], out["score"][gone], out["world"][gone] = 0, 0, np.nan
    return out, some


def misplace_hand(points: Points, count: float, rng: np.random.Generator) -> Touched:
    """count: frames in which wrist and hand of the left are found on the right hand, surely. points: (T, 133, ...) by name."""
    out, some = _copy(points), pick_run(len(points["xy"]), count / len(points["xy"]), rng)
    left = np.array([*range(133)[HANDS["left"]], ARM["left"][2]])
    to = np.ix_(some, left)
    out["xy"][to] = points["xy"][np.ix_(some, OTHER_SIDE[left])] + rng.normal(0, 1.5, (some.sum(), len(left), 2))
    out["score"][to], out["world"][to] = 0.9, points["world"][np.ix_(some, OTHER_SIDE[left])]
    return out, some


def swap_sides(points: Points, share: float, rng: np.random.Generator) -> Touched:
    """share: of the frames, those in which the person faces away, whose left and right are taken for each other.

    points: (T, 133, ...) by name.
    """
    out = _copy(points)
    width = points["xy"][:, INDEX["left_shoulder"], 0] - points["xy"][:, INDEX["right_shoulder"], 0]
    some = np.zeros(len(width), bool)
    some[np.argsort(width)[:max(1, round(share * len(width)))]] = True
    for name in ("xy", "score", "world"):
        out[name][some] = points[name][some][:, OTHER_SIDE]
    return out, some


def flicker(points: Points, share: float, rng: np.random.Generator) -> Touched:
    """share: of the frames, single ones, whose every point lies elsewhere. points: (T, 133, ...) by name."""
    out, some = _copy(points), np.zeros(len(points["xy"]), bool)
    some[1:-1:2] = pick_some(len(some[1:-1:2]), min(1, 2 * share), rng)
    body = points["xy"][:, :17]
    height = np.median(np.ptp(body[..., 1], axis=1))
    out["xy"][some] += rng.choice([-1, 1], (some.sum(), 1, 2)) * ACROSS * height
    return out, some


def jitter(points: Points, share: float, rng: np.random.Generator) -> Touched:
    """share: standard deviation of every point, of the person's height. points: (T, 133, ...) by name."""
    out = _copy(points)
    height = np.median(np.ptp(points["xy"][:, :17, 1], axis=1))
    out["xy"] += rng.normal(0, share * height, out["xy"].shape)
    return out, np.ones(len(out["xy"]), bool)


def spoil_numbers(points: Points, share: float, rng: np.random.Generator) -> Touched:
    """share: of the points whose place is no number or infinite. points: (T, 133, ...) by name."""
    out = _copy(points)
    bad = np.less(rng.random(out["score"].shape), share)
    out["xy"][bad] = rng.choice([np.nan, np.inf], (bad.sum(), 1))
    return out, np.any(bad, axis=1)


def lose_person(points: Points, share: float, rng: np.random.Generator) -> Touched:
    """share: of the frames in which the detector finds nothing. points: (T, 133, ...) by name."""
    out, some = _copy(points), pick_some(len(points["xy"]), share, rng)
    out["xy"][some], out["score"][some] = 0, 0
    for name in ("world", "face_mesh"):
        out[name][some] = np.nan
    out["pose33"][some] = 0
    return out, some


def end_early(points: Points, share: float, rng: np.random.Generator) -> Touched:
    """share: of the frames, the last ones, that the file lacks. points: (T, 133, ...) by name."""
    count = len(points["xy"])
    kept = count - max(1, round(share * count))
    return {name: array[:kept] if array.ndim else array for name, array in points.items()}, np.ones(count, bool)


def _copy(points: Points) -> Points:
    return {name: array.astype(float) if array.dtype.kind == "f" else array.copy() for name, array in points.items()}


FAULTS = (
    Fault("hand-not-found", "frames without left elbow, wrist and hand", (1, 2, 4, 8, 16), hide_hand, Origin.POINTS),
    Fault("hand-on-other", "frames in which the left hand is found on the right one", (1, 2, 4, 8, 16), misplace_hand,
          Origin.POINTS),
    Fault("sides-swapped", "share of frames, facing away, with left and right swapped", (0.04, 0.1, 0.2, 0.3, 0.4), swap_sides,
          Origin.POINTS),
    Fault("flicker", "share of single frames whose points lie elsewhere", (0.04, 0.08, 0.12, 0.2, 0.35), flicker, Origin.POINTS),
    Fault("jitter", "standard deviation of points, share of the person's height", (0.001, 0.002, 0.004, 0.008, 0.016), jitter,
          Origin.POINTS),
    Fault("no-numbers", "share of points that are NaN or infinite", (0.001, 0.01, 0.05, 0.2, 1.0), spoil_numbers, Origin.POINTS),
    Fault("not-detected", "share of frames in which nothing is found", (0.1, 0.3, 0.6, 0.9, 1.0), lose_person, Origin.POINTS),
    Fault("points-missing", "share of frames that the file lacks", (0.05, 0.2, 0.5, 0.9, 1.0), end_early, Origin.POINTS),
)
