"""One training as a curve of quality over seconds, and measures of curves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gsac.stages.contract import BadInput

WORST_S, WORST_DB = 3600.0, 20.0
"""Reference point of the hypervolume: seconds and dB."""
NOVEL = ("flip", "psnr_novel", "psnr_novel_aligned", "flip_novel", "flip_novel_aligned", "stray_alpha", "needle_share")
"""Optional metrics of a training."""


@dataclass
class Trial:
    """One training: its curve and the metrics of its end."""

    clip: str
    recipe: str
    steps: int
    seed: int
    curve: list[tuple[float, float]]
    """CPU seconds so far and held-out psnr_fg, dB."""
    cpu_s: float
    psnr_fg: float
    psnr_fg_ttpo: float | None
    ssim: float
    detail: float
    n_gaussians: int
    peak_gb: float
    flip: float | None = None
    psnr_novel: float | None = None
    """In novel poses, if their truth was rendered. `_aligned`: each pose aligned with its image first."""
    psnr_novel_aligned: float | None = None
    flip_novel: float | None = None
    flip_novel_aligned: float | None = None
    stray_alpha: float | None = None
    needle_share: float | None = None


def make_trial(clip: str, metrics: dict) -> Trial:
    """metrics: of `benchmarks.training.train`. Raises BadInput if no frame was held out."""
    curve = [(row["cpu_seconds"], row["psnr_fg"]) for row in metrics["curve"] if "psnr_fg" in row]
    if not curve or metrics["psnr_fg"] is None:
        raise BadInput(f"{clip}: no frame is held out, there is nothing to compare by")
    curve.append((metrics["cpu_seconds"], metrics["psnr_fg"]))
    return Trial(clip, metrics["recipe"], metrics["steps"], metrics["seed"], curve, metrics["cpu_seconds"], metrics["psnr_fg"],
                 metrics["psnr_fg_ttpo"], metrics["ssim"], metrics["detail"], metrics["n_gaussians"], metrics["peak_gb"],
                 **{name: metrics.get(name) for name in NOVEL})


def seconds_to(trial: Trial, quality: float) -> float | None:
    """CPU seconds of the first checkpoint that reaches the quality, dB; None if none does."""
    return next((s for s, q in trial.curve if q >= quality), None)


def pareto_front(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Points (seconds, dB) that no other beats in both, sorted by seconds."""
    out: list[tuple[float, float]] = []
    for s, q in sorted(points, key=lambda p: (p[0], -p[1])):
        if not out or q > out[-1][1]:
            out.append((s, q))
    return out


def hypervolume(points: list[tuple[float, float]]) -> float:
    """Area between the Pareto front and (`WORST_S`, `WORST_DB`), in decades times dB."""
    line = [p for p in pareto_front(points) if p[0] < WORST_S and p[1] > WORST_DB]
    ends = [s for s, _ in line[1:]] + [WORST_S] if line else []
    return sum((q - WORST_DB) * math.log10(end / s) for (s, q), end in zip(line, ends, strict=True))
