"""gsac bench forecast: what finished runs were to take by the cost model, what they took, and coefficients that fit them better."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import nnls

from gsac.pipeline.command_parser import CommandParser
from gsac.pipeline.cost_model import MODELS, Cost, Model
from gsac.pipeline.footage import Footage, footage_of_result
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput, make_config

HOLD = 0.002
"""Weight of a coefficient's relative change beside a run's relative error: what the runs do not tell stays as it was."""
CORES = 2
"""Of the machine whose coefficients the cost model has."""


class Took(NamedTuple):
    """One stage of one run."""

    run: str
    stage: str
    terms: tuple[float, ...]
    """Of the cost model."""
    cpu_seconds: float
    seconds: float
    """Wall."""


def main(argv: list[str]) -> None:
    parser = CommandParser(prog="gsac bench forecast", description=__doc__)
    parser.add_argument("runs", type=Path, nargs="+", metavar="DIR",
                        help="folders of `gsac run`, computed on the cost model's machine with nothing else at work")
    options = parser.parse_args(argv)
    took = [each for folder in options.runs for each in read_run(folder)]
    for line in (*tell_runs(took), "", *tell_fits(took)):
        print(line)


def read_run(folder: Path) -> list[Took]:
    """The stages of a run's folder that the cost model knows. Raises BadInput where there is no finished run."""
    footage = footage_of_result(folder / "split" / "frames", folder / "split" / "clip.json")
    try:
        stages = json.loads((folder / "run.json").read_text())["stages"]
    except (OSError, ValueError, KeyError):
        stages = []
    if footage is None or not stages:
        raise BadInput(f"{folder}: there is no finished run; give the folder of `gsac run`")
    project = Project.at_hand()
    return [each for row in stages if (each := _read_stage(folder.name, row, footage, project)) is not None]


def _read_stage(run: str, row: dict[str, Any], footage: Footage, project: Project) -> Took | None:
    model = MODELS.get((row["name"], "cpu"))
    terms = model and model.terms(make_config(project.stage(row["name"]), row["params"]), footage)
    return Took(run, row["name"], terms, row["cpu_seconds"], row["seconds"]) if terms and row["cpu_seconds"] > 0 else None


def told(model: Model, terms: tuple[float, ...]) -> Cost:
    """What the model says of these terms."""
    return Cost(float(np.dot(model.coefficients, terms)), model.serial)


def tell_runs(took: list[Took]) -> list[str]:
    """A table of whole runs: CPU s and wall, told and taken, with ratios."""
    lines = ["| run | CPU s told | taken | ratio | wall told, s | taken | ratio |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for run in dict.fromkeys(each.run for each in took):
        stages = [(told(MODELS[each.stage, "cpu"], each.terms), each) for each in took if each.run == run]
        cpu, wall = sum(cost.cpu_seconds for cost, _ in stages), sum(cost.seconds(CORES) for cost, _ in stages)
        cpu_took, wall_took = sum(each.cpu_seconds for _, each in stages), sum(each.seconds for _, each in stages)
        lines.append(f"| {run} | {cpu:.0f} | {cpu_took:.0f} | {cpu_took / cpu:.2f} | {wall:.0f} | {wall_took:.0f} "
                     f"| {wall_took / wall:.2f} |")
    return lines


def tell_fits(took: list[Took]) -> list[str]:
    """A table of stages: taken over told, and coefficients and serial share that fit the runs."""
    lines = ["| stage | taken over told | coefficients | serial |", "| --- | --- | --- | --- |"]
    for stage in dict.fromkeys(each.stage for each in took):
        rows, model = [each for each in took if each.stage == stage], MODELS[stage, "cpu"]
        ratios = [each.cpu_seconds / told(model, each.terms).cpu_seconds for each in rows]
        fitted = fit(np.array([each.terms for each in rows]), np.array([each.cpu_seconds for each in rows]),
                     np.array(model.coefficients))
        least_wait = min(each.seconds / each.cpu_seconds for each in rows)
        serial = min(max((least_wait - 1 / CORES) / (1 - 1 / CORES), 0.0), 1.0)
        numbers = ", ".join(f"{x:.2g}" for x in fitted)
        lines.append(f"| {stage} | {min(ratios):.2f} to {max(ratios):.2f} | {numbers} | {serial:.2f} |")
    return lines


def fit(terms: np.ndarray, cpu_seconds: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(K,) coefficients, none negative, with the least relative errors of N runs; held to those `before` (K,) by HOLD.

    terms: (N, K); cpu_seconds: (N,).
    """
    change = terms * before / cpu_seconds[:, None]
    held = np.sqrt(HOLD) * np.eye(len(before))
    found, _ = nnls(np.vstack([change, held]), np.append(np.ones(len(terms)), held.sum(0)))
    return found * before
