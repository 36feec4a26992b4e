"""The chart: quality against seconds from clip to avatar, CPU and GPU side by side, published points of others hollow."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from gsac.benchmarks.clip_colours import COLOURS
from gsac.benchmarks.speed_accuracy.published import POINTS
from gsac.benchmarks.speed_accuracy.table import groups
from gsac.benchmarks.speed_accuracy.trial import Trial

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

MARKERS = {"draft": "^", "standard": "o", "fine": "s", "paper": "X"}
QUALITIES = {"psnr_fg": "held-out PSNR on the person, as filmed, dB", "flip": "FLIP, held out, as filmed (less is better)"}
TICKS = (20, 50, 100, 200, 500, 1000, 3000, 10_000, 50_000)
FEW_TICKS = (25, 30, 35, 40, 60, 80)
CROWDED = 1.8, 1.0
"""A point up to so many times as long as an earlier one's seconds, and so many dB beside it, is named below its marker."""
SECONDS = {"cpu": "CPU seconds of all threads, clip to avatar", "cuda": "seconds by the clock, clip to avatar; training on a GPU"}


def draw(trials: list[Trial], folder: Path) -> list[Path]:
    """Writes speed_accuracy.png and speed_accuracy.svg and returns their paths.

    A point is a way's mean over its seeds with their standard deviation; thin lines are trainings on their way there. The published
    points stand by their own protocols, in the panel of PSNR on a GPU.
    """
    devices = [device for device in SECONDS if any(t.device == device for t in trials)]
    figure, panels = plt.subplots(len(QUALITIES), len(devices), figsize=(6.4 * len(devices), 8.6), layout="constrained",
                                  squeeze=False)
    colours: dict[str, str] = dict(zip(dict.fromkeys(t.clip for t in trials), COLOURS * len(trials), strict=False))
    for column, device in enumerate(devices):
        for row, (name, words) in enumerate(QUALITIES.items()):
            axes = panels[row, column]
            axes.set_xscale("log")
            for (clip, _, way), some in groups([t for t in trials if t.device == device]).items():
                _draw_way(axes, some, name, colours[clip], MARKERS[way])
            if name == "psnr_fg":
                for t in (t for t in trials if t.device == device and len(t.curve) > 1):
                    axes.plot(*zip(*t.curve, strict=True), color=colours[t.clip], lw=0.8, alpha=0.5)
                axes.set_title(f"training on {'a GPU' if device == 'cuda' else 'the CPU'}")
                if device == devices[-1]:
                    _draw_published(axes)
            axes.set_ylabel(words)
            low, high = axes.get_xlim()
            ticks = [x for x in (TICKS if high > 3 * low else FEW_TICKS) if low <= x <= high]
            axes.set_xticks(ticks, [f"{x:,}" for x in ticks])
            axes.minorticks_off()
            axes.grid(alpha=0.25, which="both", lw=0.5)
            axes.spines[["top", "right"]].set_visible(False)
        panels[-1, column].set_xlabel(SECONDS[device])
    _draw_legend(panels[-1, 0], colours, list(dict.fromkeys(t.way for t in trials)))
    paths = [folder / "speed_accuracy.png", folder / "speed_accuracy.svg"]
    for path in paths:
        figure.savefig(path, dpi=110)
    plt.close(figure)
    return paths


def _draw_way(axes: Axes, some: list[Trial], name: str, colour: str, marker: str) -> None:
    """The mean of one way's seeds, with bars of a standard deviation in seconds and quality."""
    times, values = ([x for x in found if x is not None] for found in ([t.seconds for t in some], [getattr(t, name) for t in some]))
    if times and values:
        spread = [np.std(found, ddof=1) if len(found) > 1 else 0.0 for found in (times, values)]
        axes.errorbar(np.mean(times), np.mean(values), spread[1], spread[0], fmt=marker, color=colour, ms=7, capsize=3, lw=1)


def _draw_published(axes: Axes) -> None:
    """Hollow markers of other systems, and what sets them apart."""
    points = sorted(POINTS, key=lambda point: point.seconds)
    for i, point in enumerate(points):
        crowded = any(point.seconds < CROWDED[0] * before.seconds and abs(point.psnr - before.psnr) < CROWDED[1]
                      for before in points[:i])
        axes.plot(point.seconds, point.psnr, "D", mfc="none", color="0.45", ms=6)
        axes.annotate(point.system, (point.seconds, point.psnr), xytext=(0, -12 if crowded else 6), textcoords="offset points",
                      fontsize=6, color="0.35", ha="center")
    axes.annotate("hollow: published by others, seconds of training alone, another protocol:\n"
                  "PSNR of whole white frames of 540 px on PeopleSnapshot\n(ExAvatar: NeuMan; JOintGS: NeuMan, tight boxes)",
                  (0.02, 0.985), xycoords="axes fraction", fontsize=7, color="0.35", va="top")
    axes.set(xlim=(15, 1e6), ylim=(axes.get_ylim()[0], axes.get_ylim()[1] + 3))


def _draw_legend(axes: Axes, colours: dict[str, str], ways: list[str]) -> None:
    """Colours are clips, markers are ways."""
    marks = [Line2D([], [], color=colour, lw=3, label=clip) for clip, colour in colours.items()]
    marks += [Line2D([], [], color="0.3", marker=MARKERS[way], lw=0, label=way if way != "paper" else "recipe paper")
              for way in ways]
    axes.legend(handles=marks, fontsize=7, frameon=False, ncols=2)
