"""Equal keys give equal bytes: every real stage, run twice in two processes; and what it loads is in its key."""

import importlib.metadata
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.avatar.zbuffer import interpolate, rasterise
from gsac.cache.digest import tree_digest
from gsac.pipeline.project import Project

PROJECT = Project.at_hand()
STAGES = list(PROJECT.graph.steps)
DECIDE_NOTHING = {"setuptools", "pyyaml", "colorama", "cffi", "pycparser", "charset-normalizer"}
"""Distributions that come along, most with numba, and compute no number."""
CHAIN = """
import importlib, json, os, sys
from pathlib import Path


def run_stage(name, root, values, models):
    from gsac.stages.contract import Job, make_config

    stage = importlib.import_module(f"gsac.stages.{name}").STAGE
    out = root / name
    out.mkdir()
    inputs = {port: root.parent / port if port == "clip" else root / port for port in stage.inputs}
    config = make_config(stage, values)
    importlib.import_module(f"gsac.stages.{name}.stage").run(
        Job(inputs, out, config, {model: Path(models[model]) for model in stage.models(config)}))
    files = [getattr(module, "__file__", None) or "" for module in list(sys.modules.values())]
    (root / f"{name}.loaded").write_text(json.dumps(sorted(file for file in files if "-packages" in file)))


def alone(work, *arguments):
    child = os.fork()
    if not child:
        try:
            work(*arguments)
        except BaseException as error:
            print(repr(error), file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, arguments


root, order = Path(sys.argv[1]), json.loads(sys.argv[2])
root.mkdir()
for name, values in order["stages"].items():
    alone(run_stage, name, root, values, order["models"])
"""
SMALL = {"smplx": {"rounds": 1, "iterations": 2},
         "train": {"steps": 4, "gaussians": 200, "height": 96, "holdout": 2, "pose_test_steps": 1, "curve": 2}}


def draw_photos(folder: Path) -> None:
    """A person of the open body who turns before a wall, small but such that the networks see a person."""
    folder.mkdir()
    body, frames, width, height = Body.load(), 4, 108, 192
    pose = np.zeros((frames, 55, 3))
    pose[:, 16, 2], pose[:, 17, 2] = -0.9, 0.9
    for t, yaw in enumerate(np.linspace(-np.pi, np.pi, frames, endpoint=False) + 0.1):
        pose[t, 0] = np.pi * np.array([np.cos(yaw / 2), 0, np.sin(yaw / 2)])
    person = BodyParams.from_pose(pose, np.tile([0, 0, 3.3], (frames, 1)), np.zeros(body.num_betas), np.zeros((frames, 52)),
                                  1.05 * height, (width / 2, height / 2), model=body.digest)
    colours = 0.6 + 0.25 * np.sin(9 * body.v_template + [0.0, 1, 2])
    wall = 0.3 + 0.1 * np.linspace(0, 1, height)[:, None, None]
    for t in range(frames):
        vertices = body.posed(person, [t])[0][0]
        face, bary, _ = rasterise(vertices, body.faces, person.camera(width, height))
        light = np.clip(face_frames(vertices, body.faces).R[..., 1] @ [0.3, -0.5, -0.8], 0, 1) * 0.5 + 0.5
        shown = np.clip(interpolate(colours, body.faces, face, bary) * light[face][..., None], 0, 1)
        Image.fromarray(np.uint8(np.where((face >= 0)[..., None], shown, wall) * 255)).save(folder / f"{t}.png")


@pytest.fixture(scope="module")
def two(tmp_path_factory) -> list[Path]:
    """Folders of two runs of all stages on one small person, in other processes, of other seeds of hashes and numbers of cores."""
    store = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        models = {model: str(model_path(model, store)) for name in STAGES
                  for model in PROJECT.stage(name).models(PROJECT.stage(name).config())}
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    order = json.dumps({"stages": {name: SMALL.get(name, {}) for name in STAGES}, "models": models})
    folder = tmp_path_factory.mktemp("same")
    draw_photos(folder / "clip")
    roots = [folder / "one", folder / "two"]
    cores = sorted(os.sched_getaffinity(0))
    running = [subprocess.Popen([sys.executable, "-P", "-c", CHAIN, str(root), order], stderr=subprocess.PIPE, text=True,
                                env=os.environ | {"PYTHONHASHSEED": seed},
                                preexec_fn=lambda used=used: os.sched_setaffinity(0, used))
               for root, seed, used in zip(roots, ("1", "2"), (cores, cores[:1]), strict=True)]
    for child in running:
        said = child.communicate()[1]
        assert child.returncode == 0, said
    return roots


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_two_runs_of_a_stage_give_the_same_bytes_of_every_declared_output(two, name):
    for output in PROJECT.stage(name).outputs:
        one, other = (tree_digest(root / name / output.path)[1] for root in two)
        assert one == other, f"{name}/{output.path}"


@pytest.mark.slow
@pytest.mark.parametrize("name", STAGES)
def test_whatever_a_stages_process_loads_and_may_decide_a_number_is_in_its_key(two, name):
    owners = importlib.metadata.packages_distributions()
    loaded = set()
    for file in json.loads((two[0] / f"{name}.loaded").read_text()):
        top = re.split(r"[/.]", file.split("-packages/", 1)[1])[0]
        loaded |= {re.sub(r"[-_.]+", "-", owner).lower() for owner in owners.get(top, [top])}
    declared = {package.lower() for package in PROJECT.stage(name).packages}
    assert "numpy" in loaded and loaded - DECIDE_NOTHING <= declared
