"""Fills an arm segment by segment from the last joint that is seen, then lets the palm carry the rest of the hand.

How a segment (a joint less its parent) moves between two seen frames is the method's affair: `Interpolate`.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.method import Detections, Filled, HiddenArm, Interpolate
from gsac.stages.handgap.missing_hands import runs

SCALE_LIMIT = 2.0
"""A carried hand grows or shrinks by no more than this: a palm seen end on is too short to compare with."""


def fill_by_segments(interpolate: Interpolate, out: Filled, arm: HiddenArm, detections: Detections, config: HandgapConfig) -> None:
    """interpolate: the method, see `FillArm` for the rest."""
    hand, chain, times = arm.lost[2], ARM[arm.side], detections.times
    measured = out.xy[:, chain].copy()
    spread = np.zeros(len(times))
    unknown = np.zeros(len(times), bool)
    for parent, joint, gone in zip(range(3), range(1, 4), arm.lost, strict=True):
        # A segment was seen where both of its joints were.
        seen = ~gone & (~arm.lost[parent - 1] if parent else True)
        segment = measured[:, joint] - measured[:, parent]
        vectors, known, moved = fill_segment(interpolate, segment, seen, gone, times, config)
        spread = np.hypot(np.where(gone, spread, 0), moved)
        unknown = gone & (~known | unknown)
        put = gone & ~unknown
        out.xy[put, chain[joint]] = out.xy[put, chain[parent]] + vectors[put]
        out.filled[put, chain[joint]] = True
        out.drift[put, chain[joint]] = spread[put]
    _carry_hand(out, arm.side, hand & ~unknown, hand, times)


def fill_segment(interpolate: Interpolate, segment: np.ndarray, seen: np.ndarray, gone: np.ndarray, times: np.ndarray,
                 config: HandgapConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """segment: (T, 2) px; seen, gone: (T,) bool; times: (T,) s.

    Returns vectors (T, 2) px, known (T,) bool (seen or filled), and drift (T,) px: the segment's usual speed times the time to the
    nearest seen frame; in a gap between two, times the harmonic mean of both times, halved.
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
            vectors[inside] = interpolate(segment, seen, before, after, times)[offset: offset + last - first]
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
    """segment: (T, 2) px; seen: (T,) bool; times: (T,) s. Returns px/s, root mean square over neighbouring seen frames."""
    pairs = seen[1:] & seen[:-1]
    if not pairs.any():
        return 0.0
    velocity = np.diff(segment, axis=0)[pairs] / np.diff(times)[pairs, None]
    return float(np.sqrt((velocity**2).sum(axis=1).mean()))


def _carry_hand(out: Filled, side: str, put: np.ndarray, hand: np.ndarray, times: np.ndarray) -> None:
    """The hand's other 20 points turn and scale with the palm from the seen frames on both sides, blended in time.

    put: (T,) bool, frames whose palm is filled; hand: (T,) bool, frames in which the hand is missing.
    """
    _, _, wrist, palm = ARM[side]
    others = np.setdiff1d(np.arange(133)[HANDS[side]], palm)
    seen, xy = np.flatnonzero(~hand), out.xy
    for t in np.flatnonzero(put):
        earlier, later = seen[seen < t][-1:], seen[seen > t][:1]
        anchors = np.concatenate([earlier, later])
        shapes = [turn_with_palm(xy[a, others] - xy[a, wrist], xy[a, palm] - xy[a, wrist], xy[t, palm] - xy[t, wrist])
                  for a in anchors]
        share = 0.0
        if len(anchors) == 2:
            share = (times[t] - times[anchors[0]]) / (times[anchors[1]] - times[anchors[0]])
        xy[t, others] = xy[t, wrist] + (1 - share) * shapes[0] + share * shapes[-1]
        out.filled[t, others] = True
        out.drift[t, others] = out.drift[t, palm]


def turn_with_palm(points: np.ndarray, palm_then: np.ndarray, palm_now: np.ndarray) -> np.ndarray:
    """points: (n, 2) px from the wrist; palm_then, palm_now: (2,) px from the wrist.

    Returns the points (n, 2) px after the turn and scale that bring palm_then to palm_now.
    """
    then, now = complex(*palm_then), complex(*palm_now)
    if abs(then) < 1 or abs(now) < 1e-9:
        return points.copy()
    ratio = now / then
    ratio *= np.clip(abs(ratio), 1 / SCALE_LIMIT, SCALE_LIMIT) / abs(ratio)
    moved = (points[:, 0] + 1j * points[:, 1]) * ratio
    return np.stack([moved.real, moved.imag], axis=1)
