"""Windows of hidden hands, filled by every method, and how far the palms then lie from the truth."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS, PALM
from gsac.benchmarks.handgap.clips import Clip
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.fill import METHODS, fill_gaps
from gsac.stages.handgap.missing_hands import SIDES, MissingHands, find_missing
from gsac.stages.handgap.sigma import detection_sigma, person_height

GAPS = (2, 4, 8, 16, 24, 32, 40)
MARGIN = 6
"""Seen frames at least between an inner window and the clip's ends."""


@dataclass
class Window:
    first: int
    last: int
    sides: tuple[str, ...]
    place: str
    """`inside` or `end`."""
    lost: str
    """`arm`: elbow, wrist and hand; `hand`: wrist and hand."""


def windows(frames: int, gap: int, rng, inside: int = 3) -> list[Window]:
    """At random places inside, of the left, the right and both hands in turn, and at both ends of the clip, of both."""
    room = frames - gap - 2 * MARGIN
    firsts = [(int(rng.integers(room + 1)) + MARGIN, "inside") for _ in range(inside) if room >= 0]
    turn = (("left",), ("right",), ("left", "right"))
    return [Window(first, first + gap, turn[(i + gap // 2) % 3 if where == "inside" else 2], where, lost)
            for i, (first, where) in enumerate([*firsts, (0, "end"), (frames - gap, "end")]) for lost in ("arm", "hand")]


def filled(clip: Clip, window: Window, method: str) -> tuple[np.ndarray, np.ndarray]:
    """xy (T, 133, 2) and sigma (T, 133) px, with the window masked over what the detector itself lost."""
    config = HandgapConfig(method=method, max_gap_s=99, max_hold_s=99)
    found = find_missing(clip.xy, clip.score, clip.times, config)
    hand, wrist, elbow = found.hand.copy(), found.wrist.copy(), found.elbow.copy()
    inside, xy, score = slice(window.first, window.last), clip.xy.copy(), clip.score.copy()
    for side in window.sides:
        i = SIDES.index(side)
        hand[inside, i] = wrist[inside, i] = True
        elbow[inside, i] |= window.lost == "arm"
        gone = [*range(133)[HANDS[side]], *ARM[side][1 if window.lost == "arm" else 2:3]]
        xy[inside, gone] = score[inside, gone] = 0
    world = np.where(score[..., None] > 0, clip.world, np.nan)
    out, _, drift = fill_gaps(xy, score, world, MissingHands(hand, wrist, elbow, found.misplaced), clip.times, config)
    full = detection_sigma(np.ones_like(score), person_height(xy, score))
    return out, np.hypot(full, drift)


def measure(clips: dict[str, Clip], methods=METHODS, gaps=GAPS, inside: int = 3, seed: int = 0) -> list[dict]:
    """One row a clip, window, hand and method: palm errors against the truth, and jumps where the gap begins and ends."""
    rows = []
    for name, clip in clips.items():
        rng = np.random.default_rng(seed)
        frames = np.arange(len(clip.times))
        for gap in gaps:
            for window in windows(len(frames), gap, rng, inside):
                for method in methods:
                    xy, sigma = filled(clip, window, method)
                    for side in window.sides:
                        palm = PALM[side]
                        off = xy[:, palm] - clip.truth[:, palm]
                        here = frames[window.first: window.last]
                        edges = [(a, b) for a, b in ((window.first - 1, window.first), (window.last, window.last - 1))
                                 if 0 <= a < len(frames) and clip.score[a, palm] > 0]
                        forearm = np.linalg.norm(clip.truth[:, ARM[side][2]] - clip.truth[:, ARM[side][1]], axis=1).max()
                        rows.append({"clip": name, "gap": gap, "place": window.place, "lost": window.lost, "side": side,
                                     "first": window.first, "method": method, "forearm": forearm,
                                     "errors": np.linalg.norm(off[here], axis=1),
                                     "jumps": [float(np.linalg.norm(off[a] - off[b])) for a, b in edges],
                                     "within": (np.abs(off[here]) < sigma[here, palm, None]).ravel()})
    return rows


def summary(rows: list[dict]) -> list[dict]:
    """One row for each of place, what is lost, gap length and method."""
    groups = defaultdict(list)
    for row in rows:
        groups[row["place"], row["lost"], row["gap"], row["method"]].append(row)
    out = []
    for (where, lost, gap, method), members in groups.items():
        errors = np.concatenate([m["errors"] for m in members])
        share = np.concatenate([m["errors"] / m["forearm"] for m in members])
        jumps = [j for m in members for j in m["jumps"]]
        out.append({"place": where, "lost": lost, "gap": gap, "method": method, "mean_px": errors.mean(),
                    "median_px": np.median(errors), "p95_px": np.percentile(errors, 95), "mean_forearm": share.mean(),
                    "jump_px": np.mean(jumps) if jumps else np.nan,
                    "within_sigma": np.concatenate([m["within"] for m in members]).mean(), "windows": len(members)})
    return out
