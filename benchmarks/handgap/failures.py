"""How many wrong hands are found, and how many right ones are taken for wrong."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS
from gsac.benchmarks.handgap.clips import BODY_NOISE, HAND_NOISE, Clip
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.missing_hands import SIDES, find_missing


def failures(clip: Clip, rng) -> dict[str, tuple[Clip, np.ndarray]]:
    """Name -> the clip with one kind of the detector's failures, and where hands are wrong (T, 2) bool."""
    frames, hands = len(clip.times), [np.arange(133)[HANDS[side]] for side in SIDES]
    wrists = [ARM[side][2] for side in SIDES]
    width = clip.truth[:, 5, 0] - clip.truth[:, 6, 0]
    away = np.flatnonzero(width < -0.5 * np.abs(width).max())
    out = {}

    def spoil(name: str, spans: list[tuple[int, int, int]], how) -> None:
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

    def gone(bad, at, i):
        bad.score[at, hands[i]] = 0
        bad.xy[at, hands[i]] = 0

    def on_other(bad, at, i):
        bad.xy[at, hands[i]] = clip.xy[at, hands[1 - i]] + rng.normal(0, HAND_NOISE, clip.xy[at, hands[i]].shape)
        bad.score[at, hands[i]] = 0.9

    def arm_on_other(bad, at, i):
        on_other(bad, at, i)
        bad.xy[at, wrists[i]] = clip.xy[at, wrists[1 - i]] + rng.normal(0, BODY_NOISE, clip.xy[at, wrists[i]].shape)

    def swapped(bad, at, i):
        on_other(bad, at, i)
        on_other(bad, at, 1 - i)

    def arms_swapped(bad, at, i):
        arm_on_other(bad, at, i)
        arm_on_other(bad, at, 1 - i)

    spans = [(6, 12, 0), (24, 27, 1), (38, 48, 0), (60, 70, 1)]
    flickers = [(t, t + 1, i) for i, t in enumerate((9, 25, 41, 57)) for i in (i % 2,)]
    spoil("nothing", [], gone)
    spoil("not returned", spans, gone)
    spoil("on the other hand", spans, on_other)
    spoil("arm on the other arm", spans, arm_on_other)
    spoil("flicker: not returned", flickers, gone)
    spoil("flicker: on the other hand", flickers, on_other)
    middle = int(np.median(away)) if len(away) else frames // 2
    spoil("swapped hands facing away", [(middle - 3, middle + 4, 0)], swapped)
    spoil("swapped wrists and hands facing away", [(middle - 3, middle + 4, 0)], arms_swapped)
    return out


def own_failures(clip: Clip, rng) -> dict[str, tuple[Clip, np.ndarray]]:
    """Of real detections: hands not returned, or half a hand and more from the truth."""
    wrong = np.zeros((len(clip.times), 2), bool)
    for i, side in enumerate(SIDES):
        off = np.median(np.linalg.norm(clip.xy - clip.truth, axis=2)[:, HANDS[side]], axis=1)
        size = np.median(np.ptp(clip.truth[:, HANDS[side]], axis=1).max(1))
        wrong[:, i] = (clip.score[:, HANDS[side]].max(1) < 0.3) | (off > size / 2)
    return {"the detector's own": (clip, wrong)}


def detection(clips: dict[str, Clip], failures=failures) -> list[dict]:
    """Recall and false alarms a frame and hand, by kind of failure."""
    counts = defaultdict(lambda: np.zeros(4, int))
    for number, clip in enumerate(clips.values()):
        for name, (bad, wrong) in failures(clip, np.random.default_rng(number)).items():
            missing = find_missing(bad.xy, bad.score, bad.times, HandgapConfig()).hand
            counts[name] += (missing & wrong).sum(), wrong.sum(), (missing & ~wrong).sum(), (~wrong).sum()
    return [{"failure": name, "recall": c[0] / c[1] if c[1] else np.nan, "wrong": int(c[1]), "false_alarms": c[2] / c[3],
             "right": int(c[3])} for name, c in counts.items()]
