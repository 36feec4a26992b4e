"""Truth clips for the fit, with the results of the stages before it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gsac.benchmarks.clip_runs import render_clip, run_clip
from gsac.benchmarks.fit.truth import Truth, read_truth
from gsac.cache.store import Store
from gsac.pipeline.journal import Journal
from gsac.stages.contract import BadInput
from gsac.stages.smplx import STAGE

FRAMES = 60


@dataclass
class FitCase:
    """A truth clip, ready for its fit."""

    name: str
    truth: Truth
    inputs: dict[str, Path]
    """Port of `smplx` -> file or folder."""
    detections: Path
    """keypoints.npz before hand gaps are filled."""


def render_seed(folder: Path, seed: int, say: Journal, clothing: float = 1.0) -> Path:
    """Renders a seed's clip unless it is there. clothing: factor on the thickness of clothes and hair."""
    return render_clip(folder, say, seed=seed, frames=FRAMES, clothing=clothing)


def prepare_case(folder: Path, store: Store, out: Path, say: Journal) -> FitCase:
    """Runs the stages before `smplx` with default parameters. folder: clip.mp4, mask/ and truth.npz; out: the run's folder."""
    if not (folder / "clip.mp4").is_file() or not (folder / "truth.npz").is_file():
        raise BadInput(f"{folder}: expected a truth clip (clip.mp4, mask/, truth.npz), as gsac.turntable makes it")
    run = run_clip(folder, out, dict.fromkeys(port.split("/")[0] for port in STAGE.inputs), store, say)
    return FitCase(folder.name, read_truth(folder), {port: run.path(port) for port in STAGE.inputs},
                   run.path("keypoints/keypoints.npz"))
