"""One small clip of a made-up person, taken once through the eight real stages, and the fixtures cut from that run."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.cache.root import default_root
from gsac.pipeline.project import Project
from gsac.turntable.clip import make_clip
from support.toy import Done

PROJECT = Project.at_hand()
STAGES = list(PROJECT.graph.steps)
SMALL = ("smplx.rounds=1", "smplx.iterations=2", "train.steps=4", "train.gaussians=200", "train.height=96", "train.holdout=2",
         "train.pose_test_steps=1", "train.curve=2")


class SmallRun:
    """A clip, the folder of its run, its fixtures, and the command over stores of the test's own with the user's models."""

    def __init__(self, root: Path):
        self.root, self.out, self.fixtures = root, root / "run", root / "fixtures"
        self.clip = make_clip(root / "truth", seed=3, frames=8, height=288)
        done = self.gsac("run", self.clip, "--out", self.out, *(word for setting in SMALL for word in ("--set", setting)))
        assert done.code == 0, done.err
        done = self.gsac("fixtures", self.out, "--out", self.fixtures)
        assert done.code == 0, done.err

    @property
    def manifest(self) -> dict[str, Any]:
        return json.loads((self.fixtures / "manifest.json").read_text())

    def store(self, name: str) -> Path:
        """A store that holds the models and else what commands have put there."""
        store = self.root / name
        store.mkdir(exist_ok=True)
        if not (store / "models").exists():
            (store / "models").symlink_to(default_root() / "models")
        return store

    def env(self, store: str = "store") -> dict[str, str]:
        """store: its name."""
        return os.environ | {"GSAC_CACHE": str(self.store(store)), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}

    def gsac(self, *arguments: object, store: str = "store", cwd: Path | None = None) -> Done:
        done = subprocess.run([sys.executable, "-P", "-m", "gsac.pipeline.cli", *map(str, arguments)], env=self.env(store),
                              cwd=cwd or self.root, text=True, capture_output=True, timeout=600)
        return Done(done.returncode, done.stdout, done.stderr)


@pytest.fixture(scope="session")
def small_run(tmp_path_factory):
    try:
        for name in STAGES:
            for model in PROJECT.stage(name).models(PROJECT.stage(name).config()):
                model_path(model, default_root())
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    run = SmallRun(tmp_path_factory.mktemp("replay"))
    yield run
    shutil.rmtree(run.root)
