"""What is attacked: the toy project, and gsac's own stages on a small clip of a made-up person."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from gsac.cache.root import default_root

SMALL = ("train.steps=60", "train.gaussians=600", "split.count=12", "split.max_height=240")


class SmallRun:
    """All eight stages on a clip of a made-up person, small enough for a run in seconds. Models come from the user's store."""

    def __init__(self, root: Path):
        from gsac.turntable.clip import make_clip

        self.root, self.cache, self.out = root, root / "cache", root / "out"
        self.clip = make_clip(root / "truth", seed=1, frames=16, height=320)
        self.cache.mkdir()
        shutil.copytree(default_root() / "models", self.cache / "models")

    @property
    def env(self) -> dict[str, str]:
        return os.environ | {"GSAC_CACHE": str(self.cache)}

    def command(self, *arguments: object) -> list[str]:
        settings = [word for setting in SMALL for word in ("--set", setting)]
        return [sys.executable, "-P", "-m", "gsac.pipeline.cli", *map(str, arguments), *settings]
