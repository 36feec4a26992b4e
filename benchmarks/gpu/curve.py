"""python -m gsac.benchmarks.gpu.curve --run DIR: held-out quality against seconds on the GPU, both recipes, one process each.

Writes curve.csv, a row for each checkpoint, and curve.json, the summary with the device's name. GPU seconds run from the first
step's kernels to the last's, waits included; wall seconds are those of the whole fit: first colours, upload, steps, read back.
Judging is in neither.
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import shutil
from pathlib import Path
from typing import Any

from gsac.avatar.cuda import why_not
from gsac.benchmarks import training
from gsac.pipeline.timings import add_timings
from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.train import STAGE

CHECKPOINTS = 40
"""Checkpoints of a training."""
TORCH = "torch + gsplat"
"""Device name of the baseline's curves."""
COLUMNS = ("clip", "recipe", "device", "steps", "seed", "n_gaussians", "gpu_seconds", "wall_seconds", "psnr_fg")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.gpu.curve", description=__doc__.splitlines()[0])
    parser.add_argument("--run", type=Path, action="append", required=True, metavar="DIR", help="folder of a finished `gsac run`")
    parser.add_argument("--out", type=Path, default=Path("bench-gpu"), metavar="DIR")
    parser.add_argument("--budgets", type=int, nargs="+", default=[400, 1600], metavar="STEPS", help="steps of recipe fast")
    parser.add_argument("--torch-steps", type=int, default=400, metavar="STEPS",
                        help="steps of recipe fast in torch + gsplat if that is installed; 0: none")
    options = parser.parse_args()
    if why := why_not():
        raise SystemExit(f"benchmarks.gpu.curve: {why}")
    options.out.mkdir(parents=True, exist_ok=True)
    rows, found = [], []
    for folder in options.run:
        case = training.read_run(folder)
        ends = {}
        for recipe, steps in [*(("fast", n) for n in options.budgets), ("paper", None)]:
            metrics = training.train(case, options.out / f"{case.name}_{recipe}{steps or ''}", recipe=recipe, device="cuda",
                                     gaussians=12000, curve=CHECKPOINTS, **({"steps": steps} if steps else {}))
            ends[recipe, metrics["steps"]] = metrics
            rows += list_rows(case.name, "cuda", metrics)
        if options.torch_steps and gsplat_is_here():
            metrics = _train_in_torch(case, options.out / f"{case.name}_torch", options.torch_steps)
            rows += list_rows(case.name, TORCH, metrics)
            ends[TORCH, metrics["steps"]] = metrics
        found.append(summarise(case.name, ends))
        print("\n".join(describe(found[-1])), flush=True)
    write(rows, options.out / "curve.csv")
    (options.out / "curve.json").write_text(json.dumps({"device": device_name(), "clips": found}, indent=1) + "\n")


def list_rows(clip: str, device: str, metrics: dict) -> list[tuple]:
    """Rows of curve.csv: each judged checkpoint, the end last. Raises BadInput if no frame is held out."""
    def row(at: dict) -> tuple:
        return (clip, metrics["recipe"], device, metrics["steps"], metrics["seed"], at["n_gaussians"], at["gpu_seconds"],
                at["seconds"], at["psnr_fg"])

    if metrics["psnr_fg"] is None:
        raise BadInput(f"{clip}: no frame is held out, there is no quality to draw")
    return [*(row(at) for at in metrics["curve"] if "psnr_fg" in at), row(metrics)]


def summarise(clip: str, ends: dict[tuple[str, int], dict]) -> dict:
    """The trainings' ends, and the time at which recipe fast reaches the end of paper. ends: (recipe, steps) -> metrics.json."""
    out = {"clip": clip, "trainings": [
        {"recipe": recipe, "steps": steps} | {k: m[k] for k in ("gpu_seconds", "seconds", "psnr_fg", "psnr_fg_ttpo", "n_gaussians")}
        for (recipe, steps), m in ends.items()]}
    goal = next(m["psnr_fg"] for (recipe, _), m in ends.items() if recipe == "paper")
    reached = [(at["gpu_seconds"], at["seconds"]) for (recipe, _), m in ends.items() if recipe == "fast"
               for at in m["curve"] if at.get("psnr_fg", -1) >= goal]
    on_gpu, in_all = min(reached, default=(None, None))
    return out | {"paper_psnr_fg": goal, "fast_reaches_it_gpu_seconds": on_gpu, "fast_reaches_it_seconds": in_all}


def describe(found: dict) -> list[str]:
    """A summary in sentences."""
    lines = [f"{found['clip']}: {t['recipe']}, {t['steps']} steps: {t['gpu_seconds']:.3f} s on the GPU, {t['seconds']:.2f} in all, "
             f"{t['psnr_fg']:.2f} dB (pose moved to the image: {t['psnr_fg_ttpo']:.2f}), {t['n_gaussians']} gaussians"
             for t in found["trainings"]]
    on_gpu, in_all = (found[f"fast_reaches_it_{kind}"] for kind in ("gpu_seconds", "seconds"))
    return [*lines, f"{found['clip']}: fast is at paper's {found['paper_psnr_fg']:.2f} dB after "
                    + ("no time: it never gets there" if on_gpu is None else f"{on_gpu:.3f} s on the GPU, {in_all:.2f} in all")]


def write(rows: list[tuple], path: Path) -> None:
    """Writes curve.csv."""
    with open(path, "w", newline="") as f:
        csv.writer(f).writerows([COLUMNS, *rows])


def device_name() -> str:
    """The GPU's name."""
    from gsac.avatar.cuda.device import Device

    return Device().name


def gsplat_is_here() -> bool:
    """Whether torch and gsplat are installed."""
    from importlib.util import find_spec

    return find_spec("torch") is not None and find_spec("gsplat") is not None


def _train_in_torch(case: training.Case, folder: Path, steps: int) -> dict:
    """As `training.train`, with the steps of the same stage run by torch and gsplat."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        timings = pool.apply(_in_torch, (case.inputs, folder, steps))
    return add_timings(json.loads((folder / "metrics.json").read_text()), timings)


def _in_torch(inputs: dict[str, Path], folder: Path, steps: int) -> dict[str, Any]:
    from gsac.benchmarks.gpu import baseline
    from gsac.stages.train import recipes, stage

    recipes.RECIPES["fast", "cuda"] = baseline.fit
    config = make_config(STAGE, {"device": "cuda", "gaussians": 12000, "steps": steps, "curve": CHECKPOINTS})
    timings: dict[str, Any] = {}
    stage.run(Job(inputs, folder, config, device="cuda", timing=timings.__setitem__))
    return timings


if __name__ == "__main__":
    main()
