"""The short training that merged gaussians get: how long it is and which rates it has, on every device."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from gsac.stages.train.config import FAST_STEPS, TrainConfig


class Pace(NamedTuple):
    share: float
    """Steps, as a share of the training's."""
    begin: float
    """The rates are those of a training from this share of its steps on."""
    averaged: float
    """Share of these steps, the last, whose gaussians are averaged on the CPU."""
    widened: float
    """Rate of the scales over a training's: merging leaves the scales farthest off."""


OF_SIZE = Pace(0.2, 0.15, 0.1, 3.0)
"""For a size that may become the finest level."""
GENTLE = Pace(0.1, 0.5, 0.7, 1.5)
"""For a coarser level of more than half as many: in small frames large steps would do more harm than merging did."""
FIRM = Pace(0.14, 0.15, 0.5, 3.0)
"""For a coarser level of half as many and fewer."""


def refit_steps(config: TrainConfig, pace: Pace) -> int:
    """Number of steps."""
    return max(1, round(pace.share * (config.steps or FAST_STEPS["cpu"])))


def refit_config(config: TrainConfig, pace: Pace) -> TrainConfig:
    """The configuration with the rates of a refit."""
    return replace(config, scale_rate=pace.widened * config.scale_rate)
