"""How well hidden hands are found and filled, against the truth of turning bodies: tables, CSV and a chart.

    python -m gsac.benchmarks.handgap OUT [--seeds 1 2 3 4 5] [--runs RUN TRUTH ...]

Bodies and motion are the turntable's, with sway and arm swing; nothing is rendered. A detector's errors are put on: white noise,
and a habit that changes with the view, both as large as measured on rendered clips. Windows are masked inside the clip and at
its ends, and every method fills the same windows. With --runs the same is done to real detections: RUN is a run's folder
(keypoints/keypoints.npz), TRUTH the clip's truth.npz.
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from gsac.avatar.artifacts import read_arrays
from gsac.avatar.camera import Camera
from gsac.avatar.wholebody import ARM, HANDS, LEFT_HAND, PALM
from gsac.benchmarks.turntable.clip import place, posed
from gsac.benchmarks.turntable.motion import make_motion
from gsac.benchmarks.turntable.options import TurntableOptions
from gsac.benchmarks.turntable.person import make_person
from gsac.benchmarks.turntable.render import View
from gsac.stages.handgap.config import METHODS, HandgapConfig
from gsac.stages.handgap.fill import fill_gaps
from gsac.stages.handgap.find import SIDES, Found, find_missing
from gsac.stages.handgap.sigma import detection_sigma, person_height

GAPS = (2, 4, 8, 16, 24, 32, 40)
BODY_NOISE, HAND_NOISE = 2.4, 1.0
"""px a frame, of a person 930 px tall, as measured on rendered clips; so are the next three."""
BODY_HABIT, HAND_HABIT = 6.0, 3.0
WORLD_NOISE, WORLD_HABIT = 0.015, 0.03
"""m."""
MARGIN = 6
"""Seen frames at least between an inner window and the clip's ends."""


@dataclass
class Clip:
    """T frames of one turn."""

    truth: np.ndarray  # (T, 133, 2) px
    xy: np.ndarray  # (T, 133, 2) px, as detected
    score: np.ndarray  # (T, 133)
    world: np.ndarray  # (T, 133, 3) m, as detected
    times: np.ndarray  # (T,) s


def turning_body(seed: int, frames: int = 80, habit: float = 1.0, noise: float = 1.0) -> Clip:
    """habit, noise: factors on the detector's errors."""
    options = TurntableOptions(seed=seed, frames=frames)
    person = make_person(options, np.random.default_rng([seed, 1]))
    motion = make_motion(person.body, person.joints, options, np.random.default_rng([seed, 2]))
    width, height = options.size
    camera = Camera((options.focal_px,) * 2, (width / 2, height / 2), width, height)
    view = View(camera, np.diag([1.0, -1.0, -1.0]), np.array([0, 1.25, options.focal_px * person.height_m / (0.73 * height)]))
    params = place(person, motion, view)
    points = np.stack([person.body.keypoints(posed(person, params, t)[0]) for t in range(frames)])
    truth = camera.project(points)
    rng = np.random.default_rng([seed, 6])
    sizes, habits = np.full(133, BODY_NOISE), np.full(133, BODY_HABIT)
    sizes[LEFT_HAND.start:], habits[LEFT_HAND.start:] = HAND_NOISE, HAND_HABIT
    xy = truth + noise * rng.normal(0, 1, truth.shape) * sizes[:, None] + habit * habits[:, None] * of_view(motion.yaw, 2, rng)
    world = points - points[:, [11, 12]].mean(1, keepdims=True) + WORLD_NOISE * rng.normal(0, 1, points.shape)
    return Clip(truth, xy, np.full(truth.shape[:2], 0.95), world + WORLD_HABIT * of_view(motion.yaw, 3, rng),
                np.arange(frames) / options.fps)


def of_view(yaw: np.ndarray, axes: int, rng) -> np.ndarray:
    """(T, 133, axes) smooth in the view, of standard deviation 1."""
    waves = np.concatenate([[np.cos(k * yaw), np.sin(k * yaw)] for k in (1, 2, 3)])
    return np.einsum("wt,wpa->tpa", waves, rng.normal(0, 1, (6, 133, axes))) / np.sqrt(3)


def detected(run: Path, truth: Path) -> Clip:
    """Real detections of a rendered clip; raises ArtifactError."""
    seen, known = read_arrays(run / "keypoints" / "keypoints.npz"), read_arrays(truth)
    times = np.arange(len(seen["xy"])) / float(known["fps"])
    return Clip(known["keypoints"].astype(float), seen["xy"].astype(float), seen["score"].astype(float),
                seen["world"].astype(float), times)


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
    out, _, drift = fill_gaps(xy, score, world, Found(hand, wrist, elbow, found.misplaced), clip.times, config)
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


def text(rows: list[dict], title: str) -> str:
    """Mean / median / 95 % px by gap and method, with jump and the share within sigma of the default."""
    lines = []
    for where, lost in sorted({(r["place"], r["lost"]) for r in rows}, reverse=True):
        lines += [f"\n{title}: {where}, {lost} lost; palm error px, mean / median / 95 %",
                  "gap  " + "".join(f"{m:>22}" for m in METHODS) + "   jump turning/paper  turning/forearm  within sigma"]
        for gap in sorted({r["gap"] for r in rows}):
            cell = {r["method"]: r for r in rows if (r["place"], r["lost"], r["gap"]) == (where, lost, gap)}
            if not cell:
                continue
            lines.append(f"{gap:3d}  " + "".join(
                f"{c['mean_px']:8.1f} /{c['median_px']:5.1f} /{c['p95_px']:5.0f}" for c in (cell[m] for m in METHODS))
                + f"   {cell['turning']['jump_px']:6.1f} / {cell['paper']['jump_px']:5.1f}"
                + f"  {cell['turning']['mean_forearm']:12.2f}  {cell['turning']['within_sigma']:12.2f}")
    return "\n".join(lines)


def chart(rows: list[dict], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    pairs = sorted({(r["place"], r["lost"]) for r in rows}, reverse=True)
    figure, axes = pyplot.subplots(1, len(pairs), figsize=(4 * len(pairs), 3.6), layout="constrained")
    for axis, (where, lost) in zip(np.atleast_1d(axes), pairs, strict=True):
        for method in METHODS:
            line = sorted((r["gap"], r["mean_px"]) for r in rows if (r["place"], r["lost"], r["method"]) == (where, lost, method))
            axis.plot(*zip(*line, strict=True), marker="o", ms=3, lw=2.4 if method == "turning" else 1.2, label=method)
        axis.set(title=f"{'Inside the clip' if where == 'inside' else 'At start and end'}, {lost} lost",
                 xlabel="frames missing (10 a second)", ylabel="palm error, px (mean)", yscale="log")
        axis.grid(alpha=0.3)
    np.atleast_1d(axes)[0].legend(fontsize=7)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def save(rows: list[dict], path: Path) -> None:
    with open(path, "w", newline="") as f:
        writer = csv.DictWriter(f, rows[0].keys())
        writer.writeheader()
        writer.writerows({k: round(float(v), 4) if isinstance(v, float) else v for k, v in r.items()} for r in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--runs", type=Path, nargs="*", default=[], help="RUN TRUTH pairs")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    sources = {"bodies": {f"seed {s}": turning_body(s) for s in options.seeds}}
    if options.runs:
        sources["detections"] = {str(r): detected(r, t) for r, t in zip(options.runs[::2], options.runs[1::2], strict=True)}
    for name, clips in sources.items():
        rows = summary(measure(clips))
        save(rows, options.out / f"handgap-{name}.csv")
        chart(rows, options.out / f"handgap-{name}.png")
        print(text(rows, name))
    found = detection(sources["bodies"]) + detection(sources.get("detections", {}), own_failures)
    save(found, options.out / "handgap-found.csv")
    for row in found:
        print(f"{row['failure']:38} recall {row['recall']:.3f} of {row['wrong']:4d}   false alarms {row['false_alarms']:.4f}")


if __name__ == "__main__":
    main()
