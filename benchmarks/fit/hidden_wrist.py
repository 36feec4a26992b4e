"""Error of a hidden wrist after the fit: arms and hands are masked in the detections for some frames."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import read_arrays, write_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.joints import NAMES
from gsac.avatar.wholebody import ARM, HANDS
from gsac.benchmarks.fit.clips import FitCase
from gsac.benchmarks.fit.score import joint_distances
from gsac.stages.contract import Job
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.smplx.config import SmplxConfig

GAPS = {"left": (16, 8, 4), "right": (4, 16, 8)}
"""Side -> frames without elbow, wrist and hand, of each window in order."""
MARGIN = 6
"""Least number of visible frames before and after a window."""
BAR_MM = 40.0
"""Target of the median, gaps of up to 16 frames."""


@dataclass
class Hidden:
    """One window of one clip."""

    clip: str
    side: str
    first: int
    errors_mm: np.ndarray  # (gap,) of the wrist; pelvis aligned, one scale a clip

    @property
    def gap(self) -> int:
        """Frames of the window."""
        return len(self.errors_mm)


def list_windows(frames: int) -> Iterator[tuple[str, int, int]]:
    """Side, first frame and frame after the last of each window, evenly spaced; windows without room are left out."""
    for side, gaps in GAPS.items():
        while sum(gaps) + MARGIN * (len(gaps) + 1) > frames:
            gaps = gaps[1:]
        rest = frames - sum(gaps)
        for i, gap in enumerate(gaps):
            first = rest * (i + 1) // (len(gaps) + 1) + sum(gaps[:i])
            yield side, first, first + gap


def mask_windows(keypoints: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Removes the points that the windows hide. The alpha is left: an arm may still show in the outline.

    keypoints: arrays of keypoints.npz, (T, 133, ...) each. Returns them changed, shapes (T, 133, ...).
    """
    out = {name: array.copy() for name, array in keypoints.items()}
    for side, first, last in list_windows(len(out["xy"])):
        gone = [*range(133)[HANDS[side]], *ARM[side][1:3]]
        out["xy"][first:last, gone], out["score"][first:last, gone], out["world"][first:last, gone] = 0, 0, np.nan
    return out


def measure(case: FitCase) -> list[Hidden]:
    """Masks the windows, fills by handgap's default, fits by smplx's default, and compares the wrists with the truth."""
    from gsac.stages.handgap.stage import run as fill
    from gsac.stages.smplx.stage import run as fit

    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        masked = mask_windows(read_arrays(case.detections))
        write_arrays(root / "keypoints.npz", **masked)
        split = case.inputs["split/clip.json"]
        for name in ("handgap", "smplx"):
            (root / name).mkdir()
        fill(Job({"keypoints/keypoints.npz": root / "keypoints.npz", "split/clip.json": split}, root / "handgap", HandgapConfig()))
        fit(Job(case.inputs | {"handgap/keypoints.npz": root / "handgap" / "keypoints.npz"}, root / "smplx", SmplxConfig()))
        params = BodyParams.read(root / "smplx" / "body.npz")
    off = joint_distances(Body.load(), params, case.truth)
    column = {NAMES[j]: i for i, j in enumerate(case.truth.joint)}
    return [Hidden(case.name, side, first, off[first:last, column[f"{side}_wrist"]])
            for side, first, last in list_windows(len(masked["xy"]))]


def text(found: list[Hidden]) -> str:
    """A table with a line for each length of gap, over all clips."""
    lines = ["hidden wrist after smplx, elbow and hand hidden too", "gap  windows  median mm  mean mm  worst window's median"]
    groups = [(str(gap), [h for h in found if h.gap == gap]) for gap in sorted({h.gap for h in found})]
    for name, group in [*groups, ("all", found)]:
        errors = np.concatenate([h.errors_mm for h in group])
        worst = max(np.median(h.errors_mm) for h in group)
        lines.append(f"{name:>3}  {len(group):7d}  {np.median(errors):9.1f}  {errors.mean():7.1f}  {worst:22.1f}")
    return "\n".join([*lines, f"bar  {'':7}  {BAR_MM:9.1f}"])


def write_csv(found: list[Hidden], path: Path) -> None:
    """Writes a row for each window."""
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(["clip", "side", "first", "gap", "median_mm", "mean_mm"])
        for h in found:
            sheet.writerow([h.clip, h.side, h.first, h.gap, f"{np.median(h.errors_mm):.2f}", f"{h.errors_mm.mean():.2f}"])
