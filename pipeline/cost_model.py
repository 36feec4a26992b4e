"""What a stage costs, by frames, pixels, steps and gaussians, on the machine that the coefficients were measured on.

That is a server of two cores without a GPU: whole runs in draft and standard of clips of 7 to 65 frames, by `gsac bench
forecast`; and for training on a GPU an H100. How much faster or slower another machine is, its own runs tell:
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


@dataclass(frozen=True)
class Model:
    """CPU seconds of a stage: a sum of terms, each with a coefficient that was measured (`gsac bench forecast`)."""

    terms: Callable[[Any, Footage], tuple[float, ...] | None]
    """Terms for a config and footage; None of a method that was never measured."""
    coefficients: tuple[float, ...]
    """CPU s for each of the terms."""
    serial: float
    """As in `Cost`."""


def stage_cost(stage: str, config: Any, footage: Footage, device: str) -> Cost | None:
    """Cost of a stage on a device class (cpu, cuda); None of one that is not known, or whose method was never measured."""
    model = find_model(stage, device)
    terms = model and model.terms(config, footage)
    if not (model and terms):
        return None
    return Cost(sum(each * term for each, term in zip(model.coefficients, terms, strict=True)), model.serial)


def find_model(stage: str, device: str) -> Model | None:
    """The model of a stage on a device class, where there is one."""
    return MODELS.get((stage, "cuda")) if device == "cuda" and (stage, "cuda") in MODELS else MODELS.get((stage, "cpu"))


def _split(config: Any, footage: Footage) -> tuple[float, ...]:
    return 1, footage.frames * footage.megapixels


def _keypoints(config: Any, footage: Footage) -> tuple[float, ...] | None:
    return (1, footage.frames, footage.frames * footage.megapixels) if config.detector == "mediapipe" else None


def _frames(config: Any, footage: Footage) -> tuple[float, ...]:
    return 1, footage.frames


def _segment(config: Any, footage: Footage) -> tuple[float, ...] | None:
    person = footage.frames * footage.square
    return (1, footage.frames, person, config.iterations * person) if config.method in ("pose", "selfie") else None


def _smplx(config: Any, footage: Footage) -> tuple[float, ...] | None:
    steps = config.rounds * config.iterations / 16
    return (1, steps * footage.frames, steps * footage.frames ** 2) if config.method == "lm" else None


def _train(device: str) -> Callable[[Any, Footage], tuple[float, ...] | None]:
    def terms(config: Any, footage: Footage) -> tuple[float, ...] | None:
        if config.recipe != "fast":
            return None
        fine = footage.square * min(1, (config.height or footage.height) / footage.height) ** 2
        person = PERSON * fine * 1e6  # pixels
        gaussians = config.gaussians if isinstance(config.gaussians, int) else asked_size(person, device)
        steps = config.steps or FAST_STEPS[device]
        square = fine * (1 - 0.75 * coarse_steps(person, steps) / steps)  # of a step, in the mean
        of_all = steps * (SIZE_SEARCH if config.searches_size() else 1)
        return 1, footage.frames, footage.frames * footage.square, of_all, of_all * square, of_all * gaussians
    return terms


def _once(config: Any, footage: Footage) -> tuple[float, ...]:
    return (1,)


MODELS = {
    ("split", "cpu"): Model(_split, (0.95, 0.078), 0.14),
    ("keypoints", "cpu"): Model(_keypoints, (0.41, 0.13, 0.044), 0.1),
    ("handgap", "cpu"): Model(_frames, (0.42, 0.0037), 0.0),
    ("segment", "cpu"): Model(_segment, (1.2, 0.063, 0.17, 0.055), 0.07),
    ("face", "cpu"): Model(_frames, (1.3, 0.017), 0.05),
    ("smplx", "cpu"): Model(_smplx, (3.2, 0.0073, 0.00091), 0.14),
    ("train", "cpu"): Model(_train("cpu"), (7.6, 0.28, 0.15, 0.0067, 0.045, 2.2e-7), 0.12),
    ("train", "cuda"): Model(_train("cuda"), (2.9, 0.01, 0, 0.0005, 0.0002, 1e-8), 1.0),
    ("export", "cpu"): Model(_once, (4.0,), 0.0),
}
"""By stage and device class."""
