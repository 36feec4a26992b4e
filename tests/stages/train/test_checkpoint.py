"""A training that was killed goes on where it was, and comes out as if nothing had happened."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict

import numpy as np
import pytest

from gsac.stages.train import checkpoint
from gsac.stages.train.checkpoint import Checkpoints
from gsac.stages.train.fast.trainer import AT_ONCE
from gsac.stages.train.stage import run

KILLED = """
import importlib, json, os, signal, sys
from pathlib import Path
from gsac.stages.contract import Job, make_config
from gsac.stages.train import STAGE, checkpoint
from gsac.stages.train.stage import run

inputs, out, scratch, values, stop, constants = json.loads(sys.argv[1])
checkpoint.EVERY_S, checkpoint.COST = 0.0, 1e9
for name, value in constants.items():
    module, name = name.rsplit(".", 1)
    setattr(importlib.import_module(f"gsac.stages.train.{module}"), name, value)

def progress(done, total, unit):
    if unit == "steps" and done == stop:
        os.kill(os.getpid(), signal.SIGKILL)

run(Job({port: Path(path) for port, path in inputs.items()}, Path(out), make_config(STAGE, values), scratch=Path(scratch),
        progress=progress))
"""


FEW = {"config.SIZES": (2000, 2000), "fast.size_search.SHARES": (1, 0.5)}
GROWS_SOON = {"paper.densify.FIRST": 1, "paper.densify.EVERY": 4, "paper.densify.PHASE": 2}


@pytest.mark.slow
@pytest.mark.parametrize("values, stop, constants", [
    ({"steps": 40, "exposure": True}, 14, {}), ({"steps": 60}, 56, {}), ({"steps": 30, "gaussians": "auto"}, 30, FEW),
    ({"recipe": "paper", "steps": 12}, 9, GROWS_SOON)],
    ids=["fast, while the surface moves", "fast, while steps are averaged", "fast, before the size search",
         "paper, after it has grown"])
def test_a_training_that_was_killed_and_goes_on_gives_the_bytes_of_an_unbroken_one(job, tmp_path, monkeypatch, values, stop,
                                                                                  constants):
    for name, value in constants.items():
        monkeypatch.setattr(f"gsac.stages.train.{name}", value)
    values = {"pose_test_steps": 0, "curve": 2} | values
    whole, broken = job("whole", frames=8, **values), job("broken", frames=8, **values)
    run(whole)
    broken.scratch, lost = tmp_path / "scratch" / "key", tmp_path / "lost"
    lost.mkdir()
    order = ({port: str(path) for port, path in broken.inputs.items()}, str(lost), str(broken.scratch), asdict(broken.config),
             stop, constants)
    done = subprocess.run([sys.executable, "-c", KILLED, json.dumps(order)], capture_output=True, text=True, timeout=300)
    assert done.returncode == -signal.SIGKILL, done.stderr
    steps, told = [], []
    broken.resumed = lambda *words: told.append(words)
    timings = {}
    broken.timing = timings.__setitem__
    broken.progress = lambda step, total, unit: unit == "steps" and steps.append(step)
    spent = Checkpoints(broken.scratch, broken.warn).read()["spent"][0]
    run(broken)
    assert stop < steps[0] <= stop + AT_ONCE if stop < values["steps"] else not steps
    assert told == [(stop, values["steps"], "steps")]
    for name in ("avatar.npz", "body.npz", "metrics.json"):
        assert (whole.out / name).read_bytes() == (broken.out / name).read_bytes()
    assert timings["resumed_at_step"] == stop and timings["seconds"] > spent > 0.1


@pytest.mark.parametrize("spoil", [lambda b: b[:-100], lambda b: b[:1000] + bytes([b[1000] ^ 1]) + b[1001:], lambda b: b""],
                         ids=["cut short", "one bit", "empty"])
def test_a_torn_checkpoint_is_told_and_not_read(tmp_path, spoil):
    warnings = []
    kept = Checkpoints(tmp_path, lambda finding: warnings.append(finding.message))
    kept.write({"step": 3, "deep": {"values": np.arange(1000.0)}})
    assert kept.read()["deep"]["values"][-1] == 999
    kept.path.write_bytes(spoil(kept.path.read_bytes()))
    assert kept.read() is None
    assert len(warnings) == 1 and str(kept.path) in warnings[0] and "starts anew" in warnings[0]


def test_states_come_back_as_they_were(tmp_path):
    rng = np.random.default_rng(3)
    state = {"none": None, "rng": rng.bit_generator.state, "list": [1, 2], "float": 0.1 + 0.2,
             "empty": np.zeros((0, 3), np.float32), "inner": {"a": np.arange(3, dtype=np.int64), "b": {}}}
    Checkpoints(tmp_path, print).write(state)
    back = Checkpoints(tmp_path, print).read()
    assert back["empty"].dtype == np.float32 and back["empty"].shape == (0, 3)
    np.testing.assert_array_equal(back["inner"].pop("a"), state["inner"].pop("a"))
    del back["empty"], state["empty"]
    assert back == state


def test_checkpoints_are_written_no_oftener_than_their_cost_allows(tmp_path, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(checkpoint.time, "perf_counter", lambda: clock[0])
    kept = Checkpoints(tmp_path, print)
    clock[0] += checkpoint.EVERY_S - 1
    assert not kept.due(ends=False) and not kept.due(ends=True), "a short training is not worth one"
    clock[0] += 1
    assert kept.due(ends=False)
    kept.write({})
    kept.cost = 1.0
    clock[0] += 1 / checkpoint.COST - 1
    assert not kept.due(ends=False) and kept.due(ends=True)
    clock[0] += 1
    assert kept.due(ends=False)
    assert not Checkpoints(None, print).due(ends=True)


def test_a_disk_that_takes_no_checkpoint_does_not_stop_the_training(tmp_path):
    warnings = []
    (tmp_path / "file").write_text("")
    kept = Checkpoints(tmp_path / "file" / "key", lambda finding: warnings.append(finding.message))
    kept.write({"step": 1})
    assert len(warnings) == 1 and "No checkpoint can be written" in warnings[0] and not kept.due(ends=True)
    assert not os.path.exists(tmp_path / "file" / "key")
