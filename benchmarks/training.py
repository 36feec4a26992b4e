"""Trainings for the charts: what they are fed with, and one of them in a process of its own."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.train import STAGE


@dataclass
class Case:
    """One clip that waits for training."""

    name: str
    inputs: dict[str, Path]
    """Ports of `train`."""
    novel: Path | None = None
    """Folder of a truth clip of the same person in other poses."""


def declare(parser: argparse.ArgumentParser, name: str) -> None:
    """The options that say what is trained on."""
    parser.add_argument("--seeds", type=int, nargs="*", default=None, metavar="N",
                        help="turntable clips to render and fit (default: 31, unless --run is given)")
    parser.add_argument("--frames", type=int, default=60, help="frames of such a clip (default: 60)")
    parser.add_argument("--run", type=Path, action="append", default=[], metavar="DIR",
                        help="folder of a finished `gsac run`, whose frames, masks and poses are taken; may be repeated")
    parser.add_argument("--height", type=int, default=540, help="px that are trained on (default: 540)")
    parser.add_argument("--out", type=Path, default=Path(f"bench-{name}"), metavar="DIR", help=f"default: ./bench-{name}")


def cases(options: argparse.Namespace, say, novel: int = 0, exact: bool = False) -> list[Case]:
    """Clips of the options, fitted where they are not yet.

    novel: frames of other poses of each rendered person; exact: each such clip also with the true poses, as `NAME_exact`.
    """
    seeds = options.seeds if options.seeds is not None else [] if options.run else [31]
    found = [of_run(folder) for folder in options.run]
    for seed in seeds:
        case = _rendered(seed, options, say)
        if novel:
            case.novel = clip(options.out, f"seed{seed}_novel_{novel}", say, seed=seed, frames=novel, poses="novel")
        found += [case, _exact(case, options.out)] if exact else [case]
    return found


def of_run(folder: Path) -> Case:
    """Raises BadInput naming the file that the run has not."""
    inputs = {port: folder / port for port in STAGE.inputs}
    for port, path in inputs.items():
        if not path.exists():
            raise BadInput(f"{folder}: there is no {port}; give the folder of a finished `gsac run`")
    return Case(folder.name, inputs)


def side_by_side(work: Callable, calls: list[tuple], jobs: int) -> list:
    """work(*call, cores=...) of every call, `jobs` at a time, each on its share of the cores; the results in order."""
    cores = sorted(os.sched_getaffinity(0)) if jobs > 1 else None
    shares: SimpleQueue = SimpleQueue()
    for k in range(jobs):
        shares.put(cores and cores[k * len(cores) // jobs:(k + 1) * len(cores) // jobs])

    def one(call: tuple):
        share = shares.get()
        try:
            return work(*call, cores=share)
        finally:
            shares.put(share)

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, calls))


def train(case: Case, folder: Path, cores: list[int] | None = None, **values) -> dict:
    """metrics.json of one training, and `peak_gb`, the most memory that its process held.

    folder: written anew; cores: those that it may use, all unless given.
    LPIPS is measured where its weights are in the store, but is in no loss: on the CPU recipe `paper` would take hours.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        peak = pool.apply(_train, (case.inputs, folder, values, cores))
    return json.loads((folder / "metrics.json").read_text()) | {"peak_gb": peak}


def _train(inputs: dict[str, Path], folder: Path, values: dict, cores: list[int] | None) -> float:
    if cores:
        os.sched_setaffinity(0, cores)
    from gsac.stages.train.stage import run

    config = make_config(STAGE, {"lpips": "judge"} | values)
    run(Job(inputs, folder, config, networks(config), device="cuda" if config.device == "cuda" else "cpu"))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def networks(config) -> dict[str, Path]:
    """Files of what the stage only wishes for, as far as the user has brought them."""
    from gsac.cache.store import Store
    from gsac.pipeline.model_store import ModelStore

    models = ModelStore(Store.open())
    return models.need([name for name in config.wishes() if name in models.brought], print)


def _rendered(seed: int, options: argparse.Namespace, say) -> Case:
    folder = clip(options.out, f"seed{seed}_{options.frames}", say, seed=seed, frames=options.frames)
    return fitted(options.out, folder, "", say)


def _exact(case: Case, out: Path) -> Case:
    """The case with the truth in the place of the body fit."""
    from gsac.avatar.body import Body
    from gsac.benchmarks.speed_accuracy.novel import true_params

    name = f"{case.name}_exact"
    path = out / "runs" / name / "smplx" / "body.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    true_params(out / "clips" / case.name / "truth.npz", Body.load().digest).write(path)
    return Case(name, case.inputs | {"smplx/body.npz": path}, case.novel)


def clip(out: Path, name: str, say, **turntable) -> Path:
    """Folder of the truth clip of that name, rendered where it is not yet. turntable: its options."""
    from gsac.turntable.clip import make_clip

    folder = out / "clips" / name
    if not (folder / "truth.npz").is_file():
        make_clip(folder, height=1280, progress=lambda done, total, unit: say.progress(name, done, total, unit), **turntable)
    return folder


def fitted(out: Path, folder: Path, variant: str, say, settings: tuple[str, ...] = ()) -> Case:
    """The clip run up to the body fit. settings: `stage.key=value` that make the variant."""
    from gsac.cache.store import Store
    from gsac.pipeline.params import resolve
    from gsac.pipeline.project import Project
    from gsac.pipeline.run import ClipRun, Options
    from gsac.pipeline.run_folder import RunFolder

    name = f"{folder.name}_{variant}" if variant else folder.name
    project, video = Project.at_hand(), (folder / "clip.mp4").resolve()
    configs, workspace = resolve(project, sets=settings), RunFolder(out / "runs" / name)
    workspace.prepare(video, project, configs)
    for last in ("segment", "smplx"):
        ClipRun(project, configs, Store.open(say=say.note), workspace, say).run(video, Options(until=last))
    return Case(name, {port: workspace.path(port) for port in STAGE.inputs})
