"""The trials as a table and as CSV."""

from __future__ import annotations

import csv
import typing
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from gsac.benchmarks.speed_accuracy.trial import PAPER, WAYS, Trial, seconds_to
from gsac.stages.contract import BadInput

HEAD = ("clip", "device", "way", "seeds", "steps", "gaussians", "CPU s", "wall s", "psnr_fg", "+-", "aligned", "flip", "ssim",
        "detail", "novel", "aligned", "flip", "stray", "peak GB")
DIFFERENCES = {"flip": "FLIP {:+.4f}", "psnr_novel": "novel poses {:+.2f} dB", "flip_novel": "FLIP {:+.4f}",
               "psnr_novel_aligned": "aligned {:+.2f} dB", "flip_novel_aligned": "FLIP {:+.4f}"}
"""Metric -> words for its difference between the ways' ends."""
SHEET = tuple(field.name for field in fields(Trial) if field.name != "curve")
"""Columns of the CSV, before `curve_seconds` and `curve_psnr_fg`."""
CURVE = ("curve_seconds", "curve_psnr_fg")


def groups(trials: list[Trial]) -> dict[tuple[str, str, str], list[Trial]]:
    """(clip, device, way) -> the trials of its seeds, in the order of the first ones."""
    out: dict[tuple[str, str, str], list[Trial]] = {}
    for trial in trials:
        out.setdefault((trial.clip, trial.device, trial.way), []).append(trial)
    return out


def text(trials: list[Trial]) -> str:
    """One row for each clip, device and way, then each way compared with the paper's recipe."""
    table = [HEAD, *(_row(some) for some in groups(trials).values())]
    widths = [max(len(row[c]) for row in table) for c in range(len(HEAD))]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in table]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:], "", *compare_with_paper(trials)])


def compare_with_paper(trials: list[Trial]) -> list[str]:
    """For each clip and device: the time at which each other way reaches the end of recipe paper, and the difference of their
    ends. The time of a way is its mean over seeds, the quality, too."""
    out, by = [], groups(trials)
    for clip, device in dict.fromkeys((t.clip, t.device) for t in trials):
        paper = by.get((clip, device, PAPER))
        for way in dict.fromkeys(t.way for t in trials if t.way != PAPER):
            some = by.get((clip, device, way))
            if not paper or not some:
                continue
            goal, cost = float(np.mean([t.psnr_fg for t in paper])), _mean_seconds(paper)
            reached = [s for t in some if t.seconds is not None and (s := seconds_to(t, goal)) is not None]
            first = (f"reaches paper's {goal:.2f} dB after {min(reached):.1f} s, {cost / min(reached):.1f}x sooner than paper "
                     f"({cost:.0f} s)" if reached else f"never reaches paper's {goal:.2f} dB")
            more = [words.format(np.mean([getattr(t, name) for t in some]) - np.mean([getattr(t, name) for t in paper]))
                    for name, words in DIFFERENCES.items() if all(getattr(t, name) is not None for t in [*some, *paper])]
            end = np.mean([t.psnr_fg for t in some]) - goal
            out.append(f"{clip}, {device}: {way} {first}; its end is {', '.join([f'{end:+.2f} dB', *more])}, "
                       f"in {_mean_seconds(some):.1f} s")
    return out


def _mean_seconds(some: list[Trial]) -> float:
    """Over the trials whose time is known; NaN without any."""
    known = [t.seconds for t in some if t.seconds is not None]
    return float(np.mean(known)) if known else float("nan")


def join(*sheets: list[Trial]) -> list[Trial]:
    """The trials of several sheets by device, way, clip and seed; of one that is in several, that of the last."""
    found = {(t.device, WAYS.index(t.way), t.clip, t.seed): t for sheet in sheets for t in sheet}
    return [found[key] for key in sorted(found)]


def write_csv(trials: list[Trial], path: Path) -> None:
    """Writes a row for each checkpoint of each trial, unrounded; columns before the curve's are of the trial's end."""
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow([*SHEET, *CURVE])
        for t in trials:
            sheet.writerows([*(getattr(t, name) for name in SHEET), *point] for point in t.curve)


def read_csv(path: Path) -> list[Trial]:
    """Reads what `write_csv` wrote. Raises BadInput with the names of missing columns."""
    with open(path, newline="") as f:
        rows = list(csv.DictReader(f))
    if not rows or (missing := {*SHEET, *CURVE} - set(rows[0])):
        raise BadInput(f"{path}: " + (f"there is no column {', '.join(sorted(missing))}" if rows else "there is no row")
                       + "; give the speed_accuracy.csv of another `gsac bench speed-accuracy`")
    hints = typing.get_type_hints(Trial)
    out: dict[tuple, Trial] = {}
    for row in rows:
        values: dict[str, Any] = {name: _typed(row[name], hints[name]) for name in SHEET}
        trial = out.setdefault(tuple(values[name] for name in ("clip", "device", "way", "seed")), Trial(**values))
        trial.curve.append((float(row[CURVE[0]]), float(row[CURVE[1]])))
    return list(out.values())


def _typed(cell: str, hint: type) -> str | int | float | None:
    return None if not cell else cell if hint is str else int(cell) if hint is int else float(cell)


def _row(some: list[Trial]) -> tuple[str, ...]:
    """Means over trials that differ in their seed only."""
    def mean(name: str, form: str) -> str:
        values = [getattr(t, name) for t in some if getattr(t, name) is not None]
        return format(np.mean(values), form) if values else "-"

    spread = f"{np.std([t.psnr_fg for t in some], ddof=1):.2f}" if len(some) > 1 else "-"
    one = some[0]
    return (one.clip, one.device, one.way, str(len(some)), str(one.steps), mean("n_gaussians", ".0f"), mean("cpu_s", ".1f"),
            mean("wall_s", ".1f"), mean("psnr_fg", ".2f"), spread, mean("psnr_fg_ttpo", ".2f"), mean("flip", ".4f"),
            mean("ssim", ".4f"), mean("detail", ".2f"), mean("psnr_novel", ".2f"), mean("psnr_novel_aligned", ".2f"),
            mean("flip_novel", ".4f"), mean("stray_alpha", ".4f"), mean("peak_gb", ".2f"))
