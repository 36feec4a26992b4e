"""Table, CSV and chart of palm errors."""

from __future__ import annotations

import csv
from pathlib import Path

import matplotlib

from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.fill import METHODS

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

DEFAULT = HandgapConfig.method
"""The stage's own method, drawn with a thicker line."""


def text(rows: list[dict], title: str) -> str:
    """Mean / median / 95th percentile, px, by gap and method; jumps, error in forearms and share within sigma of the default."""
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


def draw(rows: list[dict], path: Path) -> None:
    """Writes a chart with a panel for each place and lost points. rows: of `gaps.summarise`."""
    pairs = sorted({(r["place"], r["lost"]) for r in rows}, reverse=True)
    figure, axes = plt.subplots(1, len(pairs), figsize=(4 * len(pairs), 3.6), layout="constrained", squeeze=False)
    for axis, (where, lost) in zip(axes[0], pairs, strict=True):
        draw_panel(axis, rows, where, lost)
    axes[0, 0].legend(fontsize=7)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def draw_panel(axis: plt.Axes, rows: list[dict], where: str, lost: str) -> None:
    """Draws palm error against length of the gap, one line a method."""
    for method in METHODS:
        line = sorted((r["gap"], r["mean_px"]) for r in rows if (r["place"], r["lost"], r["method"]) == (where, lost, method))
        axis.plot(*zip(*line, strict=True), marker="o", ms=3, lw=2.4 if method == DEFAULT else 1.2, label=method)
    axis.set(title=f"{'Inside the clip' if where == 'inside' else 'At start and end'}, {lost} lost",
             xlabel="frames missing (10 a second)", ylabel="palm error, px (mean)", yscale="log")
    axis.grid(alpha=0.3)


def write_csv(rows: list[dict], path: Path) -> None:
    """Writes rows with equal keys."""
    with open(path, "w", newline="") as f:
        writer = csv.DictWriter(f, rows[0].keys())
        writer.writeheader()
        writer.writerows({k: round(float(v), 4) if isinstance(v, float) else v for k, v in r.items()} for r in rows)
