"""The trials as a table and as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from gsac.benchmarks.speed_accuracy.trial import NOVEL, Trial, hypervolume, seconds_to

QUALITIES = (22.0, 24.0, 25.0, 26.0, 28.0)
"""dB whose first time is a column."""
HEAD = ("clip", "recipe", "steps", "seeds", "gaussians", "CPU s", "psnr_fg", "+-", "aligned", "ssim", "detail", "flip",
        "novel", "aligned", "flip", "stray", "needles", "peak GB", *(f"s to {q:g}" for q in QUALITIES))
DIFFERENCES = {"flip": "FLIP {:+.4f}", "psnr_novel": "novel poses {:+.2f} dB", "flip_novel": "FLIP {:+.4f}",
               "psnr_novel_aligned": "aligned {:+.2f} dB", "flip_novel_aligned": "FLIP {:+.4f}"}
"""Metric -> words for its difference between the recipes' ends."""


def text(trials: list[Trial]) -> str:
    """One row for each clip, recipe and number of steps, then the comparison of the recipes."""
    table = [HEAD]
    for clip, recipe, steps in dict.fromkeys((t.clip, t.recipe, t.steps) for t in trials):
        table.append(_row([t for t in trials if (t.clip, t.recipe, t.steps) == (clip, recipe, steps)]))
    widths = [max(len(row[c]) for row in table) for c in range(len(HEAD))]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in table]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:], "", *compare_recipes(trials)])


def compare_recipes(trials: list[Trial]) -> list[str]:
    """For each clip: the time at which `fast` reaches the end of `paper`, and the difference of their ends."""
    out = []
    for clip in dict.fromkeys(t.clip for t in trials):
        fast, paper = ([t for t in trials if (t.clip, t.recipe) == (clip, recipe)] for recipe in ("fast", "paper"))
        if not fast or not paper:
            continue
        goal, cost = np.mean([t.psnr_fg for t in paper]), np.mean([t.cpu_s for t in paper])
        reached = [s for t in fast if (s := seconds_to(t, goal)) is not None]
        best = max(fast, key=lambda t: t.psnr_fg)
        first = (f"reaches paper's {goal:.2f} dB after {min(reached):.1f} CPU s, {cost / min(reached):.1f}x sooner than paper "
                 f"({cost:.0f} CPU s)" if reached else f"never reaches paper's {goal:.2f} dB")
        out.append(f"{clip}: fast {first}; its best end is {best.psnr_fg - goal:+.2f} dB, in {best.cpu_s:.1f} CPU s")
        more = [words.format(getattr(best, name) - np.mean([getattr(t, name) for t in paper]))
                for name, words in DIFFERENCES.items() if all(getattr(t, name) is not None for t in [best, *paper])]
        out += [f"{clip}: that end against paper's: {', '.join(more)}"] if more else []
        out += [f"{clip}: hypervolume of {name} {hypervolume([p for t in some for p in t.curve]):.2f} decades x dB"
                for name, some in (("fast", fast), ("paper", paper))]
    return out


def write_csv(trials: list[Trial], path: Path) -> None:
    """Writes every checkpoint, unrounded. A training's last row is its end; columns after `psnr_fg` are of the end."""
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(["clip", "recipe", "steps", "seed", "n_gaussians", "peak_gb", "cpu_seconds", "psnr_fg", *NOVEL])
        for t in trials:
            at_end = [getattr(t, name) for name in NOVEL]
            sheet.writerows([t.clip, t.recipe, t.steps, t.seed, t.n_gaussians, t.peak_gb, s, q, *at_end] for s, q in t.curve)


def _row(some: list[Trial]) -> tuple[str, ...]:
    """Means over trials that differ in their seed only."""
    def mean(name: str, form: str) -> str:
        values = [getattr(t, name) for t in some if getattr(t, name) is not None]
        return format(np.mean(values), form) if values else "-"

    times = []
    for quality in QUALITIES:
        reached = [seconds_to(t, quality) for t in some]
        times.append("-" if None in reached else f"{np.mean(reached):.1f}")
    spread = f"{np.std([t.psnr_fg for t in some], ddof=1):.2f}" if len(some) > 1 else "-"
    return (some[0].clip, some[0].recipe, str(some[0].steps), str(len(some)), mean("n_gaussians", ".0f"), mean("cpu_s", ".1f"),
            mean("psnr_fg", ".2f"), spread, mean("psnr_fg_ttpo", ".2f"), mean("ssim", ".4f"), mean("detail", ".2f"),
            mean("flip", ".4f"), mean("psnr_novel", ".2f"), mean("psnr_novel_aligned", ".2f"), mean("flip_novel", ".4f"),
            mean("stray_alpha", ".4f"), mean("needle_share", ".4f"), mean("peak_gb", ".2f"), *times)
