"""Finds the hands that were not seen, or were detected in a wrong place.

A detector that loses a hand gives it a low score, or puts its points on the other hand with a good one: the score alone does not
tell. Lengths are measured in torsos (middle of the shoulders to middle of the hips, about half a metre).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS, INDEX
from gsac.stages.handgap.config import HandgapConfig

SIDES = ("left", "right")
WRIST_APART = 0.25
"""Torsos between the body's wrist and the hand's own wrist above which the hand is not at the end of its arm."""
LONGEST = {"forearm": 0.8, "palm": 0.35}
"""Torsos; anatomy gives 0.5 and 0.2, and a limb near the lens looks up to half as long again."""
ON_OTHER = {"wrist": 0.12, "hand": 0.12}
"""Torsos between like points of both arms below which they lie on each other."""
STEP = 0.25
"""Torsos; a point that moves less than this between frames has not jumped."""
FAST = 6.0
"""Torsos a second, about 3 m/s; an arm that leaves faster and is back within RETURN frames was never there."""
RETURN = 3
SWAY = 0.12
"""Torsos that a hand may move, besides three times its usual speed, on its way to the other hand."""


@dataclass
class MissingHands:
    hand: np.ndarray
    """(T, 2) bool, left and right: the hand is missing."""
    wrist: np.ndarray
    """(T, 2) bool: the body's wrist is not seen, or wrong."""
    elbow: np.ndarray
    """(T, 2) bool: the elbow is not seen."""
    misplaced: np.ndarray
    """(T, 2) bool: the hand was detected with a good score in a wrong place."""


def find_missing(xy: np.ndarray, score: np.ndarray, times: np.ndarray | None, config: HandgapConfig) -> MissingHands:
    """xy: (T, 133, 2) px; score: (T, 133); times: (T,) s, None for photos, which have no before and after."""
    torso = torso_length(xy, score)
    misplaced = np.zeros((len(xy), 2), bool)
    wrist_wrong = np.zeros_like(misplaced)
    elbow = np.zeros_like(misplaced)
    hand_score = np.stack([np.median(score[:, HANDS[s]], axis=1) for s in SIDES], axis=1)
    given = hand_score >= config.lost_score
    for i, side in enumerate(SIDES):
        s, e, w, palm = ARM[side]
        elbow[:, i] = score[:, e] < config.seen_score
        wrist_wrong[:, i] = too_long(xy[:, w] - xy[:, e], torso, "forearm") & ~elbow[:, i]
        root = xy[:, INDEX[f"{side}_hand_wrist"]]
        wrist_given = score[:, w] >= config.lost_score
        misplaced[:, i] = (np.linalg.norm(root - xy[:, w], axis=1) > WRIST_APART * torso) & wrist_given
        misplaced[:, i] |= too_long(xy[:, palm] - root, torso, "palm")
        misplaced[:, i] |= too_long(root - xy[:, e], torso, "forearm") & ~elbow[:, i]
        if times is not None:
            wrist_wrong[:, i] |= find_excursions(xy[:, w] - xy[:, s], wrist_given, times, torso)
            misplaced[:, i] |= find_excursions(xy[:, palm] - xy[:, s], given[:, i], times, torso)
    if times is not None:
        wrists = np.stack([score[:, ARM[s][2]] >= config.lost_score for s in SIDES], axis=1)
        wrist_wrong |= find_on_other_arm(xy, wrists, [[ARM[s][2]] for s in SIDES], times, torso, ON_OTHER["wrist"])
        misplaced |= find_on_other_arm(xy, given, [np.arange(133)[HANDS[s]] for s in SIDES], times, torso, ON_OTHER["hand"])
    misplaced &= given

    wrist = wrist_wrong | np.stack([score[:, ARM[s][2]] < config.seen_score for s in SIDES], axis=1)
    hand = np.zeros_like(misplaced)
    for i in range(2):
        if times is None:
            hand[:, i] = (hand_score[:, i] < config.seen_score) | misplaced[:, i]
        else:
            hand[:, i] = drop_islands(hysteresis(hand_score[:, i], misplaced[:, i], config), config.min_seen)
    return MissingHands(hand, wrist, elbow, misplaced)


def leave_all(frames: int) -> MissingHands:
    """No hand is missing, nothing is wrong."""
    return MissingHands(*np.zeros((4, frames, 2), bool))


def torso_length(xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """xy: (T, 133, 2) px; score: (T, 133). Returns (T,) px: the frame's, but no less than the clip's upper quartile, as a bent
    torso looks short; inf, which no length exceeds, where shoulders and hips are never seen together."""
    shoulders, hips = ([INDEX[f"{s}_{part}"] for s in SIDES] for part in ("shoulder", "hip"))
    length = np.linalg.norm(xy[:, shoulders].mean(1) - xy[:, hips].mean(1), axis=-1)
    seen = score[:, shoulders + hips].min(axis=1) > 0.3
    if not seen.any():
        return np.full(len(xy), np.inf)
    return np.maximum(np.where(seen, length, 0), np.percentile(length[seen], 75))


def too_long(bone: np.ndarray, torso: np.ndarray, name: str) -> np.ndarray:
    """bone: (T, 2) px; torso: (T,) px. Returns (T,) bool: foreshortening makes a bone short, nothing makes it this long."""
    return np.linalg.norm(bone, axis=1) > LONGEST[name] * torso


def find_excursions(track: np.ndarray, given: np.ndarray, times: np.ndarray, torso: np.ndarray) -> np.ndarray:
    """track: (T, 2) px from the shoulder; given: (T,) bool, detected; times: (T,) s; torso: (T,) px.

    Returns (T,) bool: stays of up to RETURN frames off the track, left and returned to faster than an arm moves.
    """
    frames = np.flatnonzero(given)
    away = np.zeros(len(track), bool)
    if len(frames) < 3:
        return away
    step = np.linalg.norm(np.diff(track[frames], axis=0), axis=1)
    speed = step / np.diff(times[frames])
    usual = np.median(speed)
    limit = np.maximum(FAST * torso[frames[1:]], usual + 6 * 1.4826 * np.median(np.abs(speed - usual)))
    jump = (speed > limit) & (step > STEP * torso[frames[1:]])
    for first in np.flatnonzero(jump):
        for last in range(first + 1, min(first + 1 + RETURN, len(jump))):
            if jump[last] and not away[frames[first]]:
                before, after = track[frames[first]], track[frames[last + 1]]
                out = np.linalg.norm(track[frames[first + 1: last + 1]] - (before + after) / 2, axis=1).min()
                if out > 2 * np.linalg.norm(after - before):
                    away[frames[first + 1: last + 1]] = True
                break
    return away


def find_on_other_arm(xy: np.ndarray, given: np.ndarray, points: list[Sequence[int]], times: np.ndarray, torso: np.ndarray,
                      near: float) -> np.ndarray:
    """xy: (T, 133, 2) px; given: (T, 2) bool, detected; times: (T,) s; torso: (T,) px; near: torsos.

    points: indices of the left and of the right side, in the same order.
    Returns (T, 2) bool: the side whose points jumped onto the other side's, for as long as they stay there. Hands that meet without
    a jump are left alone.
    """
    apart = np.median(np.linalg.norm(xy[:, points[0]] - xy[:, points[1]], axis=2), axis=1)
    together = given.all(axis=1) & (apart < near * torso)
    if not together.any():
        return np.zeros_like(given)
    centre = xy[:, [INDEX["left_shoulder"], INDEX["right_shoulder"]]].mean(1)
    tracks = np.stack([np.median(xy[:, p], axis=1) - centre for p in points], axis=1)
    forward = _jumped(tracks, given, together, times, torso)
    backward = _jumped(tracks[::-1], given[::-1], together[::-1], -times[::-1], torso[::-1])[::-1]
    return forward | backward


def _jumped(tracks: np.ndarray, given: np.ndarray, together: np.ndarray, times: np.ndarray, torso: np.ndarray) -> np.ndarray:
    """(T, 2) bool, one pass in time: while both lie together, the one further from its last right place is wrong.

    tracks: (T, 2, 2) px; given: (T, 2) bool; together: (T,) bool; times: (T,) s; torso: (T,) px.
    """
    wrong = np.zeros_like(given)
    last = [None, None]
    usual = [_usual_speed(tracks[:, i], given[:, i] & ~together, times) for i in range(2)]
    for t in range(len(tracks)):
        if together[t] and t and together[t - 1] and wrong[t - 1].any():
            wrong[t] = wrong[t - 1]
        elif together[t] and None not in last:
            excess = []
            for i in range(2):
                moved = np.linalg.norm(tracks[t, i] - tracks[last[i], i])
                allowed = min(SWAY * torso[t] + 3 * usual[i] * (times[t] - times[last[i]]), 0.5 * torso[t])
                excess.append(moved - allowed)
            if max(excess) > 0:
                wrong[t, int(np.argmax(excess))] = True
        for i in range(2):
            if given[t, i] and not wrong[t, i]:
                last[i] = t
    return wrong


def _usual_speed(track: np.ndarray, given: np.ndarray, times: np.ndarray) -> float:
    """px/s, median over the detected frames."""
    frames = np.flatnonzero(given)
    if len(frames) < 2:
        return 0.0
    return float(np.median(np.linalg.norm(np.diff(track[frames], axis=0), axis=1) / np.diff(times[frames])))


def hysteresis(hand_score: np.ndarray, misplaced: np.ndarray, config: HandgapConfig) -> np.ndarray:
    """hand_score: (T,); misplaced: (T,) bool. Returns (T,) bool, missing: lost below `lost_score` or misplaced, seen again from
    `seen_score` on."""
    missing = np.zeros(len(hand_score), bool)
    lost = hand_score[0] < config.seen_score if len(hand_score) else True
    for t, value in enumerate(hand_score):
        lost = value < (config.seen_score if lost else config.lost_score)
        missing[t] = lost or misplaced[t]
    return missing


def drop_islands(missing: np.ndarray, min_seen: int) -> np.ndarray:
    """missing: (T,) bool. Returns (T,) bool in which short seen runs are missing too: they are false detections of a lost hand.

    Such a run is shorter than min_seen; the missing runs on both sides are no shorter and together over twice as long.
    """
    missing = missing.copy()
    edges = runs(missing)
    for (a0, a1), (s0, s1), (b0, b1) in zip(edges, edges[1:], edges[2:], strict=False):
        length = s1 - s0
        before, after = a1 - a0, b1 - b0
        if not missing[s0] and length < min_seen and min(before, after) >= length and before + after > 2 * length:
            missing[s0:s1] = True
    return missing


def runs(values: np.ndarray) -> list[tuple[int, int]]:
    """values: (T,) bool. Returns [start, end) of each run of equal values, in order."""
    if len(values) == 0:
        return []
    cuts = np.flatnonzero(np.diff(values.astype(np.int8))) + 1
    bounds = [0, *cuts.tolist(), len(values)]
    return list(zip(bounds, bounds[1:], strict=False))
