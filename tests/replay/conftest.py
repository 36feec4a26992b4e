"""One small clip of a made-up person, taken once through the eight real stages."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

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
    """A clip, the folder of its run, and the command over a store of the test's own; models are those of the user's store."""

    def __init__(self, root: Path):
        self.root, self.out = root, root / "run"
        self.clip = make_clip(root / "truth", seed=3, frames=8, height=288)
        done = self.gsac("run", self.clip, "--out", self.out, *(word for setting in SMALL for word in ("--set", setting)))
        assert done.code == 0, done.err

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

    def gsac(self, *arguments: object, store: str = "store") -> Done:
        done = subprocess.run([sys.executable, "-P", "-m", "gsac.pipeline.cli", *map(str, arguments)], env=self.env(store),
                              cwd=self.root, text=True, capture_output=True, timeout=600)
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
