"""One way from a clip to an avatar: what it took and how good it became."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gsac.pipeline.quality import QUALITIES
from gsac.stages.contract import BadInput

NOVEL = ("psnr_novel", "psnr_novel_aligned", "flip_novel", "flip_novel_aligned", "stray_alpha", "needle_share")
"""Optional metrics of a training."""
PAPER = "paper"
"""The way that trains by recipe paper; the others are presets of `--quality`."""
WAYS = (*QUALITIES, PAPER)


@dataclass
class Trial:
    """One run of a clip in one way: seconds from clip to avatar, judging left out, and the metrics of its end."""

    clip: str
    way: str
    """Preset of `--quality`, or `PAPER`."""
    device: str
    """`cpu`, or `cuda`."""
    seed: int
    steps: int
    cpu_s: float
    wall_s: float | None
    """None: others ran beside."""
    psnr_fg: float
    psnr_fg_ttpo: float | None
    flip: float | None
    ssim: float
    detail: float
    n_gaussians: int
    peak_gb: float
    psnr_novel: float | None = None
    """In novel poses, if their truth was rendered. `_aligned`: each pose aligned with its image first."""
    psnr_novel_aligned: float | None = None
    flip_novel: float | None = None
    flip_novel_aligned: float | None = None
    stray_alpha: float | None = None
    needle_share: float | None = None
    curve: list[tuple[float, float]] = field(default_factory=list)
    """Seconds so far (`seconds`) and held-out psnr_fg, dB; the last point is the end of training, before the export."""

    @property
    def seconds(self) -> float | None:
        """From clip to avatar: of all CPU threads, or, where training runs on a GPU, by the clock, if known."""
        return self.cpu_s if self.device == "cpu" else self.wall_s


def make_trial(clip: str, way: str, metrics: dict, before: np.ndarray, after: np.ndarray) -> Trial:
    """metrics: of `benchmarks.training.train`; before, after: (2,) CPU and wall seconds of the stages before training and of the
    export. Raises BadInput if no frame was held out."""
    if metrics["psnr_fg"] is None:
        raise BadInput(f"{clip}: no frame is held out, there is nothing to compare by")
    clock = 0 if metrics["device"] == "cpu" else 1
    name = ("cpu_seconds", "seconds")[clock]
    curve = [(before[clock] + row[name], row["psnr_fg"]) for row in [*metrics["curve"], metrics] if "psnr_fg" in row]
    cpu_s, wall_s = before + (metrics["cpu_seconds"], metrics["seconds"]) + after
    return Trial(clip, way, metrics["device"], metrics["seed"], metrics["steps"], cpu_s, wall_s, metrics["psnr_fg"],
                 metrics["psnr_fg_ttpo"], metrics["flip"], metrics["ssim"], metrics["detail"], metrics["n_gaussians"],
                 metrics["peak_gb"], **{name: metrics.get(name) for name in NOVEL}, curve=curve)


def seconds_to(trial: Trial, quality: float) -> float | None:
    """Seconds of the first point of the curve that reaches the quality, dB; None if none does."""
    return next((s for s, q in trial.curve if q >= quality), None)
