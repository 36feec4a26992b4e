"""The chart: quality and detail against the number of gaussians."""

from __future__ import annotations

from pathlib import Path

import matplotlib

from gsac.benchmarks.clip_colours import COLOURS

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402


def draw(curves: dict[str, list[dict]], scratch: dict[str, list[tuple[int, float]]], folder: Path) -> list[Path]:
    """Writes size.png and size.svg and returns their paths. curves: clip -> `size_curve`; scratch: clip -> (gaussians, dB)."""
    figure, (quality, detail) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for i, (clip, rows) in enumerate(curves.items()):
        colour, counts = COLOURS[i % len(COLOURS)], [r["n_gaussians"] for r in rows]
        for axes, name in ((quality, "psnr_fg"), (detail, "detail")):
            values, errors = [r[f"{name}_mean"] for r in rows], [r[f"{name}_error"] for r in rows]
            axes.errorbar(counts, values, errors, color=colour, lw=1.4, capsize=3, marker=".", label=clip)
            axes.plot(*[(r["n_gaussians"], r[f"{name}_mean"]) for r in rows if r["chosen"]][0], "o", ms=12, mfc="none",
                      color=colour, label=f"{clip}: auto")
        if scratch.get(clip):
            quality.plot(*zip(*scratch[clip], strict=True), "x", color=colour, label=f"{clip}: from the start")
    sizes = sorted({r["n_gaussians"] for rows in curves.values() for r in rows})
    quality.set(ylabel="held-out PSNR on the person, poses aligned, dB")
    detail.set(ylabel="gradient energy over the truth's")
    for axes in (quality, detail):
        axes.set(xscale="log", xlabel="gaussians")
        axes.grid(alpha=0.25, which="both", lw=0.5)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xticks(sizes, [f"{n:,}" for n in sizes], fontsize=8)
        axes.minorticks_off()
    quality.legend(fontsize=7, frameon=False, loc="lower right")
    paths = [folder / "size.png", folder / "size.svg"]
    for path in paths:
        figure.savefig(path, dpi=160)
    plt.close(figure)
    return paths
