"""The warm-up calls every compiled kernel as a training does, so that none is left to be compiled under the clock."""

import json
import subprocess
import sys

import pytest

CHILD = """
import json, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from gsac.stages.contract import Job, make_config
from gsac.stages.train import STAGE, stage


def compiled():
    return {f"{name}.{thing.py_func.__name__}{signature}" for name, module in list(sys.modules.items())
            if name.startswith("gsac.") for thing in vars(module).values() if isinstance(thing, Dispatcher)
            for signature in thing.signatures}


inputs, out, parameters = json.loads(sys.argv[1])
stage.warm("cpu")
before = compiled()
assert before
stage.run(Job({port: Path(path) for port, path in inputs.items()}, Path(out), make_config(STAGE, parameters)))
print(json.dumps(sorted(compiled() - before)))
"""


@pytest.mark.slow
def test_after_the_warm_up_a_training_compiles_nothing(job):
    made = job(steps=6, gaussians="auto")
    order = [{port: str(path) for port, path in made.inputs.items()}, str(made.out),
             {"steps": 6, "gaussians": "auto", "height": 96, "device": "cpu"}]
    child = subprocess.run([sys.executable, "-c", CHILD, json.dumps(order)], capture_output=True, text=True)
    assert child.returncode == 0, child.stderr
    assert json.loads(child.stdout.splitlines()[-1]) == []
