"""What a stage costs, by frames, pixels, steps and gaussians, on the machine that the coefficients were measured on.

That is a server of two cores without a GPU: whole runs of nine clips of 1 to 120 frames, and training at 540 and 1280 px with 700
and 1,400 steps; and for training on a GPU an H100. How much faster or slower another machine is, its own runs tell:
`pipeline.cost_forecast`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gsac.pipeline.footage import Footage
from gsac.stages.train.config import FAST_STEPS, asked_size, coarse_steps

PERSON = 0.11
"""Pixels of a person, over those of a square as high as the frame."""
SIZE_SEARCH = 1.4
"""Steps of training and of the refits of smaller sizes, over those of training alone."""


@dataclass(frozen=True)
class Cost:
    """Time of one stage."""

    cpu_seconds: float
    serial: float
    """Share of the CPU seconds that one core spends alone."""

    def seconds(self, cores: int) -> float:
        """s, wall, on so many cores."""
        return self.cpu_seconds * (self.serial + (1 - self.serial) / cores)


def stage_cost(stage: str, config: Any, footage: Footage, device: str) -> Cost | None:
    """Cost of a stage on a device class (cpu, cuda); None of one that is not known, or whose method was never measured."""
    return _COSTS[stage](config, footage, device) if stage in _COSTS else None


def _split(config: Any, footage: Footage, device: str) -> Cost:
    return Cost(0.2 + 0.045 * footage.frames * footage.megapixels, 0.15)


def _keypoints(config: Any, footage: Footage, device: str) -> Cost | None:
    if config.detector != "mediapipe":
        return None
    return Cost(0.25 + footage.frames * (0.1 + 0.01 * footage.megapixels), 0.1)


def _handgap(config: Any, footage: Footage, device: str) -> Cost:
    return Cost(0.25 + 0.005 * footage.frames, 0.0)


def _segment(config: Any, footage: Footage, device: str) -> Cost:
    of_outline = 0.05 + 0.05 * config.iterations
    return Cost(0.4 + footage.frames * (0.03 + of_outline * footage.square), 0.15)


def _face(config: Any, footage: Footage, device: str) -> Cost:
    return Cost(0.55 + 0.012 * footage.frames, 0.1)


def _smplx(config: Any, footage: Footage, device: str) -> Cost | None:
    if config.method != "lm":
        return None
    steps = config.rounds * config.iterations / 16
    return Cost(1.3 + steps * (0.03 * footage.frames + 0.0006 * footage.frames ** 2), 0.6)


def _train(config: Any, footage: Footage, device: str) -> Cost | None:
    if config.recipe != "fast":
        return None
    fine = footage.square * min(1, (config.height or footage.height) / footage.height) ** 2
    person = PERSON * fine * 1e6  # pixels
    gaussians = config.gaussians if isinstance(config.gaussians, int) else asked_size(person, device)
    steps = config.steps or FAST_STEPS[device]
    square = fine * (1 - 0.75 * coarse_steps(person, steps) / steps)  # of a step, in the mean
    search = SIZE_SEARCH if config.searches_size() else 1
    if device == "cuda":
        return Cost(2.9 + 0.01 * footage.frames + search * steps * (0.0005 + 0.0002 * square + 1e-8 * gaussians), 1.0)
    poses_and_judging = 3 + footage.frames * (0.15 + 0.25 * footage.square)
    return Cost(poses_and_judging + search * steps * (0.007 + 0.04 * square + 2e-7 * gaussians), 0.38)


def _export(config: Any, footage: Footage, device: str) -> Cost:
    return Cost(1.8, 0.0)


_COSTS: dict[str, Callable[[Any, Footage, str], Cost | None]] = {
    "split": _split, "keypoints": _keypoints, "handgap": _handgap, "segment": _segment, "face": _face, "smplx": _smplx,
    "train": _train, "export": _export,
}
