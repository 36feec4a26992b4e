"""The stages of one clip with one fault, run in this process; each result is kept in a folder and made once."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.artifacts import frame_paths, read_arrays, write_arrays
from gsac.avatar.frame_files import read_alpha, write_alpha
from gsac.benchmarks.stability.fault import Origin
from gsac.cache.store import Store
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.worker import check_outputs
from gsac.stages.contract import Job, Stage, make_config

BEFORE = ("keypoints", "segment", "face")
"""Stages that do not differ from method to method."""
SAID = "findings.json"
"""What a stage said, beside its outputs."""

Finding = dict[str, Any]
"""A finding as `--json` has it, with its message."""


def run_stage(name: str, values: dict[str, Any], ports: dict[str, Path], folder: Path) -> list[Finding]:
    """Runs a stage unless folder holds its result, and adds its outputs to ports. Returns what it said.

    values: parameters that differ from the defaults; ports: port -> file or folder.
    """
    stage: Stage = importlib.import_module(f"gsac.stages.{name}").STAGE
    if not (folder / SAID).is_file():
        folder.parent.mkdir(parents=True, exist_ok=True)
        half = Path(tempfile.mkdtemp(dir=folder.parent, prefix=".half-"))
        try:
            _compute(stage, values, ports, half)
            with contextlib.suppress(OSError):  # another process was faster
                os.rename(half, folder)
        finally:
            shutil.rmtree(half, ignore_errors=True)
    ports |= {f"{name}/{output.path}": folder / output.path for output in stage.outputs}
    return json.loads((folder / SAID).read_text())


def read_artifact(origin: Origin, path: Path) -> Any:
    """What a fault of that origin changes: arrays by name, or masks (T, H, W)."""
    return np.stack([read_alpha(p) for p in frame_paths(path)]) if origin is Origin.ALPHA else read_arrays(path)


def write_artifact(origin: Origin, value: Any, path: Path) -> None:
    """Writes what `read_artifact` reads. value: arrays by name, or masks (T, H, W)."""
    if origin is not Origin.ALPHA:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_arrays(path, **value)
        return
    path.mkdir(parents=True, exist_ok=True)
    for t, alpha in enumerate(value):
        write_alpha(path / f"{t:06d}.exr", alpha)


def _compute(stage: Stage, values: dict[str, Any], ports: dict[str, Path], out: Path) -> None:
    said: list[Finding] = []
    config = make_config(stage, values)
    store = ModelStore(Store.open())
    names = [*stage.models(config), *(name for name in stage.wishes(config) if store.has(name))]
    models = store.need(names, lambda *words: None) if names else {}
    run = importlib.import_module(f"gsac.stages.{stage.name}.stage").run
    run(Job({port: ports[port] for port in stage.inputs}, out, config, models,
            warn=lambda finding: said.append(finding.to_json() | {"message": finding.message})))
    check_outputs(stage, out)
    (out / SAID).write_text(json.dumps(said))
