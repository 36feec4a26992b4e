"""Recall and false alarms in finding wrong hands, by kind of the detector's failure."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS
from gsac.benchmarks.handgap.clips import BODY_NOISE, HAND_NOISE, HandClip
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.missing_hands import SIDES, find_missing

Failures = dict[str, tuple[HandClip, np.ndarray]]
"""Kind of failure -> the clip with it, and where hands are wrong (T, 2) bool, left and right."""


def simulate_failures(clip: HandClip, rng: np.random.Generator) -> Failures:
    """Adds each kind of failure to a copy of the clip; a hand is wrong if it is lost or far, 12 % of the torso, from the truth."""
    frames, hands = len(clip.times), [np.arange(133)[HANDS[side]] for side in SIDES]
    wrists = [ARM[side][2] for side in SIDES]
    width = clip.truth[:, 5, 0] - clip.truth[:, 6, 0]
    away = np.flatnonzero(width < -0.5 * np.abs(width).max())
    out = {}

    def spoil(name: str, spans: list[tuple[int, int, int]], how: Callable[[HandClip, slice, int], None]) -> None:
        """Applies `how` to frames and hand of each span: first, last + 1, index of the side."""
        bad, wrong = replace(clip, xy=clip.xy.copy(), score=clip.score.copy()), np.zeros((frames, 2), bool)
        for first, last, i in spans:
            how(bad, slice(first, last), i)
            wrong[first:last, i] = True
        if "swapped" in name:
            wrong |= wrong[:, ::-1]
        far = np.median(np.linalg.norm(bad.xy - clip.truth, axis=2)[:, np.stack(hands, 1)], axis=1)
        torso = np.linalg.norm(clip.truth[:, [5, 6]].mean(1) - clip.truth[:, [11, 12]].mean(1), axis=1)[:, None]
        lost = np.stack([bad.score[:, h].max(1) == 0 for h in hands], 1)
        out[name] = bad, wrong & (lost | (far > 0.12 * torso))

    def remove(bad: HandClip, at: slice, i: int) -> None:
        bad.score[at, hands[i]] = 0
        bad.xy[at, hands[i]] = 0

    def put_on_other(bad: HandClip, at: slice, i: int) -> None:
        bad.xy[at, hands[i]] = clip.xy[at, hands[1 - i]] + rng.normal(0, HAND_NOISE, clip.xy[at, hands[i]].shape)
        bad.score[at, hands[i]] = 0.9

    def put_arm_on_other(bad: HandClip, at: slice, i: int) -> None:
        put_on_other(bad, at, i)
        bad.xy[at, wrists[i]] = clip.xy[at, wrists[1 - i]] + rng.normal(0, BODY_NOISE, clip.xy[at, wrists[i]].shape)

    def swap(bad: HandClip, at: slice, i: int) -> None:
        put_on_other(bad, at, i)
        put_on_other(bad, at, 1 - i)

    def swap_arms(bad: HandClip, at: slice, i: int) -> None:
        put_arm_on_other(bad, at, i)
        put_arm_on_other(bad, at, 1 - i)

    spans = [(6, 12, 0), (24, 27, 1), (38, 48, 0), (60, 70, 1)]
    flickers = [(t, t + 1, i) for i, t in enumerate((9, 25, 41, 57)) for i in (i % 2,)]
    spoil("nothing", [], remove)
    spoil("not returned", spans, remove)
    spoil("on the other hand", spans, put_on_other)
    spoil("arm on the other arm", spans, put_arm_on_other)
    spoil("flicker: not returned", flickers, remove)
    spoil("flicker: on the other hand", flickers, put_on_other)
    middle = int(np.median(away)) if len(away) else frames // 2
    spoil("swapped hands facing away", [(middle - 3, middle + 4, 0)], swap)
    spoil("swapped wrists and hands facing away", [(middle - 3, middle + 4, 0)], swap_arms)
    return out


def find_own_failures(clip: HandClip, rng: np.random.Generator) -> Failures:
    """The failures (T, 2) bool in real detections: hands not returned, or farther than half a hand from the truth."""
    wrong = np.zeros((len(clip.times), 2), bool)
    for i, side in enumerate(SIDES):
        off = np.median(np.linalg.norm(clip.xy - clip.truth, axis=2)[:, HANDS[side]], axis=1)
        size = np.median(np.ptp(clip.truth[:, HANDS[side]], axis=1).max(1))
        wrong[:, i] = (clip.score[:, HANDS[side]].max(1) < 0.3) | (off > size / 2)
    return {"the detector's own": (clip, wrong)}


def measure_detection(clips: dict[str, HandClip],
                      failures: Callable[[HandClip, np.random.Generator], Failures] = simulate_failures) -> list[dict]:
    """Recall and false alarms per frame and hand; one row a kind of failure."""
    counts = defaultdict(lambda: np.zeros(4, int))
    for number, clip in enumerate(clips.values()):
        for name, (bad, wrong) in failures(clip, np.random.default_rng(number)).items():
            missing = find_missing(bad.xy, bad.score, bad.times, HandgapConfig()).hand
            counts[name] += (missing & wrong).sum(), wrong.sum(), (missing & ~wrong).sum(), (~wrong).sum()
    return [{"failure": name, "recall": c[0] / c[1] if c[1] else np.nan, "wrong": int(c[1]), "false_alarms": c[2] / c[3],
             "right": int(c[3])} for name, c in counts.items()]
