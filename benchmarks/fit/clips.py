"""Truth clips for the fit, and what the stages before it see in them. Both are made once and kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gsac.benchmarks.fit.truth import Truth, read_truth
from gsac.cache.store import Store
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.run_folder import RunFolder
from gsac.stages.contract import BadInput
from gsac.stages.smplx import STAGE

FRAMES, HEIGHT = 60, 1280


@dataclass
class Case:
    """One clip that waits for its fit."""

    name: str
    truth: Truth
    inputs: dict[str, Path]
    """Ports of `smplx`."""
    detections: Path
    """keypoints.npz before the hand gaps are filled."""


def truth_folder(folder: Path, seed: int, say: PlainReporter, clothing: float = 1.0) -> Path:
    """The turntable's clip of a seed, rendered unless it is there; clothing: thickness of clothes and hair, a factor."""
    if not (folder / "truth.npz").is_file():
        from gsac.turntable.clip import make_clip

        make_clip(folder, seed=seed, frames=FRAMES, height=HEIGHT, clothing=clothing,
                  progress=lambda done, total, unit: say.progress(folder.name, done, total, unit))
    return folder


def seen(folder: Path, store: Store, out: Path, say: PlainReporter) -> Case:
    """Runs what `smplx` takes with the default parameters, or takes it from the store. folder: clip.mp4, mask/, truth.npz."""
    if not (folder / "clip.mp4").is_file() or not (folder / "truth.npz").is_file():
        raise BadInput(f"{folder}: expected a truth clip (clip.mp4, mask/, truth.npz), as gsac.turntable makes it")
    project = Project.at_hand()
    configs = resolve(project)
    workspace = RunFolder(out)
    clip = (folder / "clip.mp4").resolve()
    workspace.prepare(clip, project, configs)
    for last in dict.fromkeys(port.split("/")[0] for port in STAGE.inputs):
        ClipRun(project, configs, store, workspace, say).run(clip, Options(until=last))
    return Case(folder.name, read_truth(folder), {port: workspace.path(port) for port in STAGE.inputs},
                workspace.path("keypoints/keypoints.npz"))
