"""The chart: retained quality against severity, one thin line a fault, the median thick; a panel for each method."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from gsac.benchmarks.stability.fault import SEVERITIES
from gsac.benchmarks.stability.outcome import BREAKDOWN, Curve
from gsac.benchmarks.stability.trial import DEFAULT, PAPER

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

COLOURS = {PAPER: "#b5532a", DEFAULT: "#0b6e4f"}
TITLES = {PAPER: "the paper's method", DEFAULT: "ours"}
NAMED = 4
"""Faults that are named, the worst ones."""
LINE = 0.035
"""Least distance of two names."""


def draw(curves: list[Curve], folder: Path) -> list[Path]:
    """Writes stability.png and stability.svg and returns their paths. A panel shows the faults that its method was tried with."""
    methods = [m for m in COLOURS if any(c.method == m for c in curves)]
    size = 5.6 * len(methods), 4.6
    figure, panels = plt.subplots(1, len(methods), figsize=size, layout="constrained", squeeze=False, sharey=True)
    for axes, method in zip(panels[0], methods, strict=True):
        some = sorted((c for c in curves if c.method == method), key=lambda c: c.area)
        lines = np.array([np.interp(SEVERITIES, c.severities, c.retained) for c in some])
        axes.fill_between(SEVERITIES, lines.min(0), lines.max(0), color=COLOURS[method], alpha=0.08, lw=0)
        axes.plot(SEVERITIES, lines.T, color=COLOURS[method], lw=0.7, alpha=0.45)
        axes.plot(SEVERITIES, np.median(lines, axis=0), color=COLOURS[method], lw=3.2)
        axes.axhline(BREAKDOWN, color="0.6", lw=0.8, ls=":")
        height = -np.inf
        for name, end in sorted(zip((c.fault for c in some[:NAMED]), lines[:, -1], strict=False), key=lambda named: named[1]):
            height = max(end, height + LINE)
            axes.text(5.06, height, name, fontsize=7, color="0.35", va="center")
        areas = [c.area for c in some]
        axes.set(title=f"{TITLES[method]}: {len(some)} faults, area: median {np.median(areas):.2f}, worst {min(areas):.2f}",
                 xlabel="severity", xlim=(0, 5.9), ylim=(-0.02, 1.02), xticks=list(SEVERITIES))
        axes.title.set_fontsize(9)
        axes.grid(alpha=0.25, lw=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0, 0].set_ylabel("retained quality (1: clean clip, 0: a body that stands still)")
    paths = [folder / "stability.png", folder / "stability.svg"]
    for path in paths:
        figure.savefig(path, dpi=130)
    plt.close(figure)
    return paths
