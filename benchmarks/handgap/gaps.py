"""Palm error in windows of hidden hands, filled by every method."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from gsac.avatar.wholebody import ARM, HANDS, PALM
from gsac.benchmarks.handgap.clips import HandClip
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.fill import METHODS, fill_gaps
from gsac.stages.handgap.missing_hands import SIDES, MissingHands, find_missing
from gsac.stages.handgap.sigma import detection_sigma, person_height

GAPS = (2, 4, 8, 16, 24, 32, 40)
"""Lengths of windows, frames."""
MARGIN = 6
"""Least number of visible frames between an inner window and the clip's ends."""


@dataclass
class Window:
    """Frames in which hands are hidden."""

    first: int
    last: int
    """The frame after the last."""
    sides: tuple[str, ...]
    place: str
    """`inside` or `end`."""
    lost: str
    """`arm`: elbow, wrist and hand; `hand`: wrist and hand."""


def place_windows(frames: int, gap: int, rng: np.random.Generator, inside: int = 3) -> list[Window]:
    """`inside` random windows of `gap` frames, of left, right and both hands alternately, and one of both hands at each end."""
    room = frames - gap - 2 * MARGIN
    firsts = [(int(rng.integers(room + 1)) + MARGIN, "inside") for _ in range(inside) if room >= 0]
    turn = (("left",), ("right",), ("left", "right"))
    return [Window(first, first + gap, turn[(i + gap // 2) % 3 if where == "inside" else 2], where, lost)
            for i, (first, where) in enumerate([*firsts, (0, "end"), (frames - gap, "end")]) for lost in ("arm", "hand")]


def fill_window(clip: HandClip, window: Window, method: str) -> tuple[np.ndarray, np.ndarray]:
    """Masks the window, fills it and all that the detector lost. Returns xy (T, 133, 2) px and sigma (T, 133) px."""
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


def measure(clips: dict[str, HandClip], methods: Collection[str] = METHODS, gaps: Sequence[int] = GAPS, inside: int = 3,
            seed: int = 0) -> list[dict]:
    """One row a clip, window, hand and method: palm errors against the truth, and jumps at the gap's start and end."""
    rows = []
    for name, clip in clips.items():
        rng = np.random.default_rng(seed)
        frames = np.arange(len(clip.times))
        for gap in gaps:
            for window in place_windows(len(frames), gap, rng, inside):
                for method in methods:
                    xy, sigma = fill_window(clip, window, method)
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


def summarise(rows: list[dict]) -> list[dict]:
    """Averages the rows of `measure` by place, lost points, length of the gap and method."""
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
