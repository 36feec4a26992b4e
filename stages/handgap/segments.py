"""Fills an arm segment by segment from the last joint that is seen, then the hand with its palm."""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS
from gsac.stages.handgap import gp, hermite, paper, paper_literal
from gsac.stages.handgap.missing_hands import runs

METHODS = {"paper": paper.fill, "paper-literal": paper_literal.fill, "hermite": hermite.fill, "gp": gp.fill}
"""Each: (segment (T, 2), seen (T,), before, after, times (T,)) -> (after - before - 1, 2)."""
SCALE_LIMIT = 2.0
"""A carried hand grows or shrinks by no more than this: a palm seen end on has hardly a length to compare with."""


def fill_arm(xy, filled, drift, side, lost, times, config) -> None:
    """xy (T, 133, 2), filled (T, 133) and drift (T, 133) in place; lost: (3, T) bool of elbow, wrist and hand."""
    hand = lost[2]
    chain = ARM[side]
    measured = xy[:, chain].copy()
    spread = np.zeros(len(times))
    unknown = np.zeros(len(times), bool)
    for parent, joint, gone in zip(range(3), range(1, 4), lost, strict=True):
        # A segment was seen where both of its joints were.
        seen = ~gone & (~lost[parent - 1] if parent else True)
        segment = measured[:, joint] - measured[:, parent]
        vectors, known, moved = fill_segment(segment, seen, gone, times, config)
        spread = np.hypot(np.where(gone, spread, 0), moved)
        unknown = gone & (~known | unknown)
        put = gone & ~unknown
        xy[put, chain[joint]] = xy[put, chain[parent]] + vectors[put]
        filled[put, chain[joint]] = True
        drift[put, chain[joint]] = spread[put]
    carry_hand(xy, filled, drift, side, hand & ~unknown, hand, times)


def fill_segment(segment, seen, gone, times, config) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """segment: (T, 2) px; seen, gone: (T,) bool.

    Returns vectors (T, 2), known (T,) bool (seen or filled), drift (T,) px: speed of the seen segment times the time
    to the seen frames (harmonic of both for a gap between two).
    """
    vectors, known, drift = segment.copy(), seen.copy(), np.zeros(len(times))
    speed = usual_speed(segment, seen, times)
    for first, last in runs(gone):
        if not gone[first]:
            continue
        earlier, later = np.flatnonzero(seen[:first]), last + np.flatnonzero(seen[last:])
        inside = slice(first, last)
        if len(earlier) and len(later):
            before, after = int(earlier[-1]), int(later[0])
            if times[after] - times[before] > config.max_gap_s:
                continue
            offset = first - before - 1
            vectors[inside] = METHODS[config.method](segment, seen, before, after, times)[offset: offset + last - first]
            since, until = times[inside] - times[before], times[after] - times[inside]
            drift[inside] = speed * since * until / (since + until)
            known[inside] = True
        elif len(earlier) or len(later):
            nearest = int(earlier[-1] if len(earlier) else later[0])
            away = np.abs(times[inside] - times[nearest])
            vectors[inside] = segment[nearest]
            drift[inside] = speed * away
            known[inside] = away <= config.max_hold_s
    return vectors, known, drift


def usual_speed(segment: np.ndarray, seen: np.ndarray, times: np.ndarray) -> float:
    """px/s, root mean square over neighbouring seen frames."""
    pairs = seen[1:] & seen[:-1]
    if not pairs.any():
        return 0.0
    velocity = np.diff(segment, axis=0)[pairs] / np.diff(times)[pairs, None]
    return float(np.sqrt((velocity**2).sum(axis=1).mean()))


def carry_hand(xy, filled, drift, side, put, hand, times) -> None:
    """The hand's other 20 points turn and scale with the palm from the seen frames on both sides, blended in time."""
    _, _, wrist, palm = ARM[side]
    others = np.setdiff1d(np.arange(133)[HANDS[side]], palm)
    seen = np.flatnonzero(~hand)
    for t in np.flatnonzero(put):
        earlier, later = seen[seen < t][-1:], seen[seen > t][:1]
        anchors = np.concatenate([earlier, later])
        shapes = [carried(xy[a, others] - xy[a, wrist], xy[a, palm] - xy[a, wrist], xy[t, palm] - xy[t, wrist])
                  for a in anchors]
        share = 0.0
        if len(anchors) == 2:
            share = (times[t] - times[anchors[0]]) / (times[anchors[1]] - times[anchors[0]])
        xy[t, others] = xy[t, wrist] + (1 - share) * shapes[0] + share * shapes[-1]
        filled[t, others] = True
        drift[t, others] = drift[t, palm]


def carried(points: np.ndarray, palm_then: np.ndarray, palm_now: np.ndarray) -> np.ndarray:
    """points: (n, 2) px from the wrist; the turn and scale that bring palm_then to palm_now, as complex numbers."""
    then, now = complex(*palm_then), complex(*palm_now)
    if abs(then) < 1 or abs(now) < 1e-9:
        return points.copy()
    ratio = now / then
    ratio *= np.clip(abs(ratio), 1 / SCALE_LIMIT, SCALE_LIMIT) / abs(ratio)
    moved = (points[:, 0] + 1j * points[:, 1]) * ratio
    return np.stack([moved.real, moved.imag], axis=1)
