"""Trainings for the charts: what they are fed with, and one of them in a process of its own."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import shutil
from dataclasses import dataclass
from pathlib import Path

from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.train import STAGE


@dataclass
class Case:
    """One clip that waits for training."""

    name: str
    inputs: dict[str, Path]
    """Ports of `train`."""


def declare(parser: argparse.ArgumentParser, name: str) -> None:
    """The options that say what is trained on."""
    parser.add_argument("--seeds", type=int, nargs="*", default=None, metavar="N",
                        help="turntable clips to render and fit (default: 31, unless --run is given)")
    parser.add_argument("--frames", type=int, default=60, help="frames of such a clip (default: 60)")
    parser.add_argument("--run", type=Path, action="append", default=[], metavar="DIR",
                        help="folder of a finished `gsac run`, whose frames, masks and poses are taken; may be repeated")
    parser.add_argument("--height", type=int, default=540, help="px that are trained on (default: 540)")
    parser.add_argument("--out", type=Path, default=Path(f"bench-{name}"), metavar="DIR", help=f"default: ./bench-{name}")


def cases(options: argparse.Namespace, say) -> list[Case]:
    """Clips of the options, fitted where they are not yet."""
    seeds = options.seeds if options.seeds is not None else [] if options.run else [31]
    found = [of_run(folder) for folder in options.run]
    return found + [_rendered(seed, options, say) for seed in seeds]


def of_run(folder: Path) -> Case:
    """Raises BadInput naming the file that the run has not."""
    inputs = {port: folder / port for port in STAGE.inputs}
    for port, path in inputs.items():
        if not path.exists():
            raise BadInput(f"{folder}: there is no {port}; give the folder of a finished `gsac run`")
    return Case(folder.name, inputs)


def train(case: Case, folder: Path, **values) -> dict:
    """metrics.json of one training, and `peak_gb`, the most memory that its process held. folder: written anew.

    LPIPS is measured where its weights are in the store, but is in no loss: on the CPU recipe `paper` would take hours.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        peak = pool.apply(_train, (case.inputs, folder, values))
    return json.loads((folder / "metrics.json").read_text()) | {"peak_gb": peak}


def _train(inputs: dict[str, Path], folder: Path, values: dict) -> float:
    from gsac.stages.train.stage import run

    config = make_config(STAGE, {"lpips": "judge"} | values)
    run(Job(inputs, folder, config, networks(config), device="cuda" if config.device == "cuda" else "cpu"))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def networks(config) -> dict[str, Path]:
    """Files of what the stage only wishes for, as far as the user has brought them."""
    from gsac.cache.store import Store
    from gsac.pipeline.models import Models

    models = Models(Store.open())
    return models.need([name for name in config.wishes() if name in models.brought], print)


def _rendered(seed: int, options: argparse.Namespace, say) -> Case:
    folder = clip(options.out, f"seed{seed}_{options.frames}", say, seed=seed, frames=options.frames)
    return fitted(options.out, folder, "", say)


def clip(out: Path, name: str, say, **turntable) -> Path:
    """Folder of the truth clip of that name, rendered where it is not yet. turntable: its options."""
    from gsac.benchmarks.turntable.clip import make_clip

    folder = out / "clips" / name
    if not (folder / "truth.npz").is_file():
        make_clip(folder, height=1280, progress=lambda done, total, unit: say.progress(name, done, total, unit), **turntable)
    return folder


def fitted(out: Path, folder: Path, variant: str, say, settings: tuple[str, ...] = ()) -> Case:
    """The clip run up to the body fit. settings: `stage.key=value` that make the variant."""
    from gsac.cache.store import Store
    from gsac.pipeline.params import resolve
    from gsac.pipeline.project import Project
    from gsac.pipeline.run import Chain, Options
    from gsac.pipeline.workspace import Workspace

    name = f"{folder.name}_{variant}" if variant else folder.name
    project, video = Project.at_hand(), (folder / "clip.mp4").resolve()
    configs, workspace = resolve(project, sets=settings), Workspace(out / "runs" / name)
    workspace.prepare(video, project, configs)
    for last in ("segment", "smplx"):
        Chain(project, configs, Store.open(say=say.note), workspace, say).run(video, Options(until=last))
    return Case(name, {port: workspace.path(port) for port in STAGE.inputs})
