"""The chart: quality against seconds, one panel a clip."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib

from gsac.benchmarks.gpu.curve import TORCH, Curve
from gsac.benchmarks.speed_accuracy.trial import Trial, pareto_front

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

COLOURS = {"fast": "#0b6e4f", "paper": "#b5532a"}
GPU_LINES = {"cuda": "--", TORCH: ":"}


def draw(trials: list[Trial], folder: Path, on_gpu: Sequence[Curve] = ()) -> list[Path]:
    """Writes speed_accuracy.png and speed_accuracy.svg and returns their paths.

    A line is a training, its dot the end; grey steps are the Pareto front of the clip on the CPU. on_gpu: drawn dashed (torch
    dotted) over seconds on the GPU.
    """
    clips = list(dict.fromkeys(t.clip for t in [*trials, *on_gpu]))
    figure, panels = plt.subplots(1, len(clips), figsize=(5.4 * len(clips), 4.4), layout="constrained", squeeze=False)
    for axes, clip in zip(panels[0], clips, strict=True):
        own = [t for t in trials if t.clip == clip]
        if best := pareto_front([p for t in own for p in t.curve]):
            axes.step(*zip(*best, strict=True), where="post", color="0.75", lw=5, alpha=0.6, zorder=0, label="Pareto line, CPU")
        named = set()
        for t in own:
            colour, kind = COLOURS[t.recipe], (t.recipe, t.steps)
            label = None if kind in named else f"{t.recipe}, {t.steps} steps, {t.n_gaussians} gaussians"
            named.add(kind)
            axes.plot(*zip(*t.curve, strict=True), color=colour, lw=1.4, alpha=0.8, label=label)
            axes.plot(*t.curve[-1], "o", color=colour, ms=6)
            axes.annotate(f"{t.psnr_fg:.1f}", t.curve[-1], xytext=(5, 5), textcoords="offset points", fontsize=7, color=colour)
        for c in (c for c in on_gpu if c.clip == clip):
            axes.plot(*zip(*c.points, strict=True), GPU_LINES[c.device], color=COLOURS[c.recipe], lw=1.4,
                      label=f"{c.recipe}, {c.steps} steps, {'GPU' if c.device == 'cuda' else c.device}, {c.n_gaussians} gaussians")
            axes.plot(*c.points[-1], "D", color=COLOURS[c.recipe], ms=5)
            axes.annotate(f"{c.points[-1][1]:.1f}", c.points[-1], xytext=(5, 5), textcoords="offset points", fontsize=7,
                          color=COLOURS[c.recipe])
        seconds = "seconds of training: of all CPU threads, or of the GPU (dashed)" if on_gpu else "CPU seconds of training"
        axes.set(xscale="log", xlabel=seconds, ylabel="held-out PSNR on the person, dB", title=clip)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.grid(alpha=0.25, which="both", lw=0.5)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=7, frameon=False, loc="lower right")
    paths = [folder / "speed_accuracy.png", folder / "speed_accuracy.svg"]
    for path in paths:
        figure.savefig(path, dpi=160)
    plt.close(figure)
    return paths
