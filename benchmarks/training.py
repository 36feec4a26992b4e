"""Trainings for the charts: their clips, and one training in a process of its own."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from gsac.benchmarks.clip_runs import render_clip, run_clip
from gsac.cache.store import Store
from gsac.pipeline.journal import Journal
from gsac.pipeline.rows import read_json, rows_of
from gsac.pipeline.run_folder import RUN
from gsac.pipeline.timings import add_timings
from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.train import STAGE
from gsac.stages.train.config import TrainConfig


@dataclass
class Case:
    """A clip with its body fit, ready for training."""

    name: str
    inputs: dict[str, Path]
    """Port of `train` -> file or folder."""
    novel: Path | None = None
    """Folder of a truth clip of the same person in other poses."""
    before: np.ndarray = field(default_factory=lambda: np.zeros(2))
    """(2,) CPU and wall seconds of the stages before training, when they ran."""


def declare(parser: argparse.ArgumentParser, name: str) -> None:
    """Adds the options that choose the clips."""
    parser.add_argument("--seeds", type=int, nargs="*", default=None, metavar="N",
                        help="turntable clips to render and fit (default: 31, unless --run is given)")
    parser.add_argument("--frames", type=int, default=60, help="frames of such a clip (default: 60)")
    parser.add_argument("--run", type=Path, action="append", default=[], metavar="DIR",
                        help="folder of a finished `gsac run`, whose frames, masks and poses are taken; may be repeated")
    parser.add_argument("--height", type=int, default=None, help="px that are trained on (default: the frames' own)")
    parser.add_argument("--out", type=Path, default=Path(f"bench-{name}"), metavar="DIR", help=f"default: ./bench-{name}")


def prepare_cases(options: argparse.Namespace, say: Journal, novel: int = 0, exact: bool = False, variant: str = "",
                  settings: tuple[str, ...] = ()) -> list[Case]:
    """The clips of the options, rendered and fitted unless they are kept.

    novel: frames in novel poses to render of each person; exact: adds each rendered clip with its true poses, `NAME_exact`;
    variant, settings: of `fit_clip`, for rendered clips. A finished run is taken as it is.
    """
    seeds = options.seeds if options.seeds is not None else [] if options.run else [31]
    found = [read_run(folder) for folder in options.run]
    for seed in seeds:
        clip = render_clip(clip_folder(options.out, f"seed{seed}_{options.frames}"), say, seed=seed, frames=options.frames)
        case = fit_clip(options.out, clip, variant if settings else "", say, settings)
        if novel:
            case.novel = render_clip(clip_folder(options.out, f"seed{seed}_novel_{novel}"), say, seed=seed, frames=novel,
                                     poses="novel")
        found += [case, with_truth(case, clip, options.out)] if exact else [case]
    return found


def read_run(folder: Path) -> Case:
    """The case of a finished run. Raises BadInput with the name of a missing file."""
    inputs = {port: folder / port for port in STAGE.inputs}
    for port, path in inputs.items():
        if not path.exists():
            raise BadInput(f"{folder}: there is no {port}; give the folder of a finished `gsac run`")
    return Case(folder.name, inputs, before=seconds_before(folder))


def seconds_before(folder: Path) -> np.ndarray:
    """(2,) CPU and wall seconds of the stages of a run before training; a stage of the cache has those of when it ran."""
    rows = rows_of(read_json(folder / RUN))
    ahead = list(rows.values())[:list(rows).index(STAGE.name) if STAGE.name in rows else None]
    return np.array([sum(row.get(name) or 0.0 for row in ahead) for name in ("cpu_seconds", "seconds")])


def side_by_side(work: Callable, calls: list[tuple], jobs: int) -> list:
    """Runs work(*call, cores=...) for every call, `jobs` at a time, each on its share of the cores. Returns results in order."""
    cores = sorted(os.sched_getaffinity(0)) if jobs > 1 else None
    shares: SimpleQueue = SimpleQueue()
    for k in range(jobs):
        shares.put(cores and cores[k * len(cores) // jobs:(k + 1) * len(cores) // jobs])

    def one(call: tuple) -> Any:
        share = shares.get()
        try:
            return work(*call, cores=share)
        finally:
            shares.put(share)

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, calls))


def train(case: Case, folder: Path, cores: list[int] | None = None, **values: Any) -> dict:
    """Trains one case. Returns metrics.json with the training's timings, and `peak_gb`, the peak memory of its process.

    folder: emptied first; cores: numbers of the CPU cores to use, None for all; values: parameters of the stage.
    LPIPS is measured if its weights are in the store, but is in no loss: on the CPU recipe `paper` would take hours.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        timings, peak = pool.apply(_train, (case.inputs, folder, values, cores))
    return add_timings(json.loads((folder / "metrics.json").read_text()), timings) | {"peak_gb": peak}


def _train(inputs: dict[str, Path], folder: Path, values: dict, cores: list[int] | None) -> tuple[dict[str, Any], float]:
    if cores:
        os.sched_setaffinity(0, cores)
    from gsac.stages.train.stage import run

    config = make_config(STAGE, {"lpips": "judge"} | values)
    timings: dict[str, Any] = {}
    run(Job(inputs, folder, config, _find_networks(config), device="cuda" if config.device == "cuda" else "cpu",
            timing=timings.__setitem__))
    return timings, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def export(case: Case, folder: Path, cores: list[int] | None = None) -> np.ndarray:
    """Exports a training's avatar into its folder `export`. Returns (2,) CPU and wall seconds. folder, cores: of `train`."""
    (folder / "export").mkdir()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_export, (case.inputs["split/clip.json"], folder, cores))


def _export(clip: Path, folder: Path, cores: list[int] | None) -> np.ndarray:
    if cores:
        os.sched_setaffinity(0, cores)
    from gsac.stages.export import STAGE as EXPORT
    from gsac.stages.export.stage import run

    began = np.array([time.process_time(), time.perf_counter()])
    run(Job({"split/clip.json": clip, "train/avatar.npz": folder / "avatar.npz", "train/body.npz": folder / "body.npz"},
            folder / "export", make_config(EXPORT, {})))
    return np.array([time.process_time(), time.perf_counter()]) - began


def _find_networks(config: TrainConfig) -> dict[str, Path]:
    """Files of the optional networks that the user has brought."""
    from gsac.pipeline.model_store import ModelStore

    models = ModelStore(Store.open())
    return models.need([name for name in config.wishes() if name in models.brought], print)


def with_truth(case: Case, clip: Path, out: Path) -> Case:
    """The case with the true body in place of the fitted one. clip: folder of the truth clip; out: for the body's file."""
    from gsac.avatar.body import Body
    from gsac.benchmarks.speed_accuracy.novel_poses import read_true_params

    name = f"{case.name}_exact"
    path = out / "runs" / name / "smplx" / "body.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    read_true_params(clip / "truth.npz", Body.load().digest).write(path)
    return Case(name, case.inputs | {"smplx/body.npz": path}, case.novel, case.before)


def clip_folder(out: Path, name: str) -> Path:
    """Folder of a rendered truth clip."""
    return out / "clips" / name


def fit_clip(out: Path, folder: Path, variant: str, say: Journal, settings: tuple[str, ...] = ()) -> Case:
    """Runs a truth clip up to the body fit.

    folder: of the clip; variant: name of the settings, empty for the defaults; settings: `stage.key=value`.
    """
    name = f"{folder.name}_{variant}" if variant else folder.name
    run = run_clip(folder, out / "runs" / name, ("segment", "smplx"), Store.open(say=say.note), say, settings)
    return Case(name, {port: run.path(port) for port in STAGE.inputs}, before=seconds_before(run.root))
