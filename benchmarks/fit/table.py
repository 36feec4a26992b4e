"""The trials as a table and as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from gsac.benchmarks.fit.trial import FitTrial

COLUMNS = (
    ("joints_median_mm", "joints median mm", "{:.1f}", 20.0),
    ("joints_mean_mm", "mean mm", "{:.1f}", 30.0),
    ("vertices_mean_mm", "vertices mm", "{:.1f}", 30.0),
    ("skin_mean_mm", "skin mm", "{:.1f}", None),
    ("iou_mean", "IoU mean", "{:.3f}", 0.93),
    ("iou_worst", "worst", "{:.3f}", 0.88),
    ("iou_of_truth", "truth's", "{:.3f}", None),
    ("reprojection_px", "repr. px", "{:.1f}", 6.0),
    ("acceleration_ratio", "accel.", "{:.2f}", None),
    ("acceleration_error_ratio", "its error", "{:.2f}", 1.5),
    ("focal_error", "focal off", "{:.1%}", None),
)
"""Score, heading, format, and target if there is one."""


def rows(trials: list[FitTrial]) -> list[list[str]]:
    """Heading, one row a trial, for several clips the mean of each method and focal setting, and the targets."""
    head = ["clip", "focal", "method", *(heading for _, heading, _, _ in COLUMNS), "wall s", "CPU s"]
    out = [head, *(_row(t.clip, [t]) for t in trials)]
    kinds = dict.fromkeys((t.focal_given, t.method) for t in trials)
    if len({t.clip for t in trials}) > 1:
        out += [_row("all clips", [t for t in trials if (t.focal_given, t.method) == kind]) for kind in kinds]
    bars = ["-" if bar is None else form.format(bar) for _, _, form, bar in COLUMNS]
    return [*out, ["bar", "given", "lm", *bars, "5.0", "-"]]


def text(trials: list[FitTrial]) -> str:
    """The table in columns."""
    table = rows(trials)
    widths = [max(len(row[c]) for row in table) for c in range(len(table[0]))]
    lines = ["  ".join(cell.ljust(w) if c < 3 else cell.rjust(w) for c, (cell, w) in enumerate(zip(row, widths, strict=True)))
             for row in table]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def compare_speed(trials: list[FitTrial]) -> list[str]:
    """Speed and error of `lm` relative to `paper`, a sentence a focal setting."""
    out = []
    for given in (True, False):
        both = {m: [t for t in trials if t.method == m and t.focal_given == given] for m in ("lm", "paper")}
        if not all(both.values()):
            continue
        wall, cpu, error = ({m: np.mean([pick(t) for t in ts]) for m, ts in both.items()} for pick in (
            lambda t: t.wall_s, lambda t: t.cpu_s, lambda t: t.scores["joints_mean_mm"]))
        focal = "given" if given else "not given"
        out.append(f"focal {focal}: lm is {wall['paper'] / wall['lm']:.1f}x faster than paper by the clock and "
                   f"{cpu['paper'] / cpu['lm']:.1f}x by CPU time, at {error['lm'] / error['paper']:.2f} of its mean joint error")
    return out


def write_csv(trials: list[FitTrial], path: Path) -> None:
    """Writes every trial with every score, unrounded."""
    names = sorted({name for t in trials for name in t.scores})
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(["clip", "method", "focal_given", "wall_s", "cpu_s", *names])
        for t in trials:
            scores = [f"{t.scores[n]:.6g}" if n in t.scores else "" for n in names]
            sheet.writerow([t.clip, t.method, t.focal_given, f"{t.wall_s:.3f}", f"{t.cpu_s:.3f}", *scores])


def _row(clip: str, trials: list[FitTrial]) -> list[str]:
    cells = []
    for name, _, form, _ in COLUMNS:
        known = [t.scores[name] for t in trials if name in t.scores]
        cells.append(form.format(np.mean(known)) if known else "-")
    focal = "given" if trials[0].focal_given else "found" if trials[0].method == "lm" else "guess"
    return [clip, focal, trials[0].method, *cells, f"{np.mean([t.wall_s for t in trials]):.1f}",
            f"{np.mean([t.cpu_s for t in trials]):.1f}"]
