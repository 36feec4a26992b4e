"""What is attacked: the toy project, and gsac's own stages on a small clip of a made-up person."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from gsac.cache.root import default_root
from support.toy import Toy


class SmallRun:
    """All eight stages on a clip of a made-up person, small enough for a run in seconds. Models come from the user's store."""

    settings = ("--set", "train.steps=60", "--set", "train.gaussians=600", "--set", "split.count=12", "--set",
                "split.max_height=240")

    def __init__(self, root: Path):
        self.root, self.cache, self.out = root, root / "cache", root / "out"
        self.clip = film_person(root / "truth", seed=1)
        self.cache.mkdir()
        shutil.copytree(default_root() / "models", self.cache / "models")

    @property
    def env(self) -> dict[str, str]:
        return os.environ | {"GSAC_CACHE": str(self.cache)}

    def command(self, *arguments: object) -> list[str]:
        return [sys.executable, "-P", "-m", "gsac.pipeline.cli", *map(str, arguments), *self.settings]


class FitRun(SmallRun):
    """The six stages from the clip to the body fit, on eight frames: most kills for the time."""

    settings = ("--until", "smplx", "--set", "split.count=8", "--set", "split.max_height=240")


class ToyBatch(Toy):
    """Three clips of the toy project."""

    def __init__(self, root: Path):
        super().__init__(root)
        self.clips = root / "clips"
        self.clips.mkdir()
        for name, words in (("one", "alpha beta"), ("two", "gamma delta"), ("three", "epsilon zeta")):
            (self.clips / f"{name}.mp4").write_text(words)


class FitBatch(FitRun):
    """Three clips of made-up persons, to the body fit."""

    def __init__(self, root: Path):
        super().__init__(root)
        self.clips = root / "clips"
        self.clips.mkdir()
        for seed in (1, 2, 3):
            film_person(root / f"truth-{seed}", seed).rename(self.clips / f"{seed}.mp4")


def film_person(folder: Path, seed: int) -> Path:
    """A clip of the made-up person of this seed, 16 frames 320 px high."""
    from gsac.turntable.clip import make_clip

    return make_clip(folder, seed=seed, frames=16, height=320)
