"""After its rehearsal a stage compiles and imports nothing more: that is done while a stage before it is at work."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import Clip
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.stages.smplx.warmup import write_inputs

CHILD = """
import importlib, json, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from gsac.stages.contract import Job


def loaded():
    return set(sys.modules) | {f"{name}.{thing.py_func.__name__}{signature}" for name, module in list(sys.modules.items())
                               if name.startswith("gsac.") for thing in vars(module).values() if isinstance(thing, Dispatcher)
                               for signature in thing.signatures}


name, inputs, out = json.loads(sys.argv[1])
declared = importlib.import_module(f"gsac.stages.{name}").STAGE
stage = importlib.import_module(f"gsac.stages.{name}.stage")
stage.warm("cpu")
before = loaded()
stage.run(Job({port: Path(path) for port, path in inputs.items()}, Path(out), declared.config()))
print(json.dumps(sorted(loaded() - before)))
"""


def loaded_by(name: str, inputs: dict[str, Path], out: Path) -> list[str]:
    """Modules, and kernels with their types, that only the run itself loads."""
    out.mkdir()
    order = json.dumps([name, {port: str(path) for port, path in inputs.items()}, str(out)])
    child = subprocess.run([sys.executable, "-c", CHILD, order], capture_output=True, text=True)
    assert child.returncode == 0, child.stderr
    return json.loads(child.stdout.splitlines()[-1])


@pytest.mark.slow
def test_after_the_rehearsal_a_fit_loads_nothing(tmp_path):
    assert loaded_by("smplx", write_inputs(Body.load(), tmp_path), tmp_path / "out") == []


@pytest.mark.slow
def test_after_the_rehearsal_an_export_loads_nothing(tmp_path):
    body = Body.load()
    inputs = {port: tmp_path / Path(port).name for port in ("split/clip.json", "train/avatar.npz", "train/body.npz")}
    Clip(10.0, [0.0, 0.1], 72, 128, 150.0, "").write(inputs["split/clip.json"])
    BodyParams.from_pose(np.zeros((2, 55, 3)), np.tile([0.0, 0.0, 2.5], (2, 1)), np.zeros(4), np.zeros((2, 52)), 150.0, (36, 64),
                         model=body.digest).write(inputs["train/body.npz"])
    finest, *coarser = (Gaussians.area(body.v_template, body.faces, count, seed=1) for count in (900, 300, 100))
    finest.light = np.full((4, 3), 0.5, np.float32)
    finest.write(inputs["train/avatar.npz"], coarser)
    assert loaded_by("export", inputs, tmp_path / "out") == []
