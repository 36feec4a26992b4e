"""The chart: joint error against seconds for both fitting methods, palm error against length of the gap for all hand methods."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from gsac.benchmarks.fit.trial import FitTrial
from gsac.benchmarks.handgap.table import draw_panel as draw_gaps

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

COLOURS = {"lm": "#0b6e4f", "paper": "#b5532a"}
LABELS = {"lm": "lm: Levenberg-Marquardt, all frames at once", "paper": "paper: published co-registration, Adam"}
BAR_MM, BAR_S = 30.0, 5.0
"""Target of the fit: mean joint error, and seconds for 60 frames."""
TICKS_S = [n * 10.0**power for power in range(-1, 4) for n in (1, 2, 5)]


def draw(trials: list[FitTrial], filled: list[dict], folder: Path) -> list[Path]:
    """Writes fit.png and fit.svg and returns their paths. filled: rows of `handgap.gaps.summarise`; none: no second panel."""
    figure, axes = plt.subplots(1, 1 + bool(filled), figsize=(7.2 + 4.6 * bool(filled), 4.8), layout="constrained", squeeze=False)
    draw_fits(axes[0, 0], trials)
    if filled:
        draw_gaps(axes[0, 1], filled, "inside", "arm")
        axes[0, 1].spines[["top", "right"]].set_visible(False)
        axes[0, 1].legend(fontsize=7, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
    paths = [folder / "fit.png", folder / "fit.svg"]
    for path in paths:
        figure.savefig(path, dpi=160)
    plt.close(figure)
    return paths


def draw_fits(axes: plt.Axes, trials: list[FitTrial]) -> None:
    """Draws joint error against CPU seconds: filled marks are given the focal length, a light line joins both fits of a clip.

    CPU seconds do not depend on the machine's other load, and both methods keep one core busy.
    """
    for clip, given in dict.fromkeys((t.clip, t.focal_given) for t in trials):
        pair = sorted((t for t in trials if (t.clip, t.focal_given) == (clip, given)), key=lambda t: t.cpu_s)
        axes.plot([t.cpu_s for t in pair], [t.scores["joints_mean_mm"] for t in pair], color="0.85", lw=1, zorder=1)
    for method, given in dict.fromkeys((t.method, t.focal_given) for t in trials):
        some = [t for t in trials if (t.method, t.focal_given) == (method, given)]
        colour = COLOURS[method]
        axes.scatter([t.cpu_s for t in some], [t.scores["joints_mean_mm"] for t in some], s=52, zorder=3, linewidths=1.6,
                     edgecolors=colour, facecolors=colour if given else "white",
                     label=f"{LABELS[method]}, focal {'given' if given else 'not given'}")
    for clip, method in dict.fromkeys((t.clip, t.method) for t in trials):
        some = [t for t in trials if (t.clip, t.method) == (clip, method)]
        last = max(some, key=lambda t: t.cpu_s)
        axes.annotate(clip, (last.cpu_s, last.scores["joints_mean_mm"]), xytext=(7, 4), textcoords="offset points", fontsize=7,
                      color="0.4")
    axes.add_patch(plt.Rectangle((1e-3, 0), BAR_S - 1e-3, BAR_MM, color=COLOURS["lm"], alpha=0.07, lw=0, zorder=0))
    times = np.array([t.cpu_s for t in trials])
    axes.set(xscale="log", xlabel="CPU seconds after detection, one clip", ylabel="body joints, mean error (mm)",
             xlim=(min(times.min(), BAR_S) / 2, times.max() * 2.2), ylim=(0, None))
    axes.text(axes.get_xlim()[0] * 1.08, BAR_MM, f" the bar: {BAR_MM:.0f} mm in {BAR_S:.0f} s", va="bottom", fontsize=7,
              color=COLOURS["lm"])
    low, high = axes.get_xlim()
    axes.set_xticks([x for x in TICKS_S if low <= x <= high], minor=False)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.grid(alpha=0.25, which="both", lw=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=7, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
