"""The short training that merged gaussians get: how long it is and which rates it has, on every device."""

from __future__ import annotations

from dataclasses import replace

from gsac.stages.train.config import FAST_STEPS, TrainConfig

SHARE, BEGIN = 0.2, 0.15
"""Steps, as a share of the training's; their rates are those of a training from this share of its steps on."""
AVERAGED = 0.1
"""Share of these steps, the last, whose gaussians are averaged: a single step has just followed the one frame that it saw."""
WIDENED = 3.0
"""Rate of the scales over a training's: merging leaves the scales farthest off."""


def refit_steps(config: TrainConfig) -> int:
    """Number of steps."""
    return max(1, round(SHARE * (config.steps or FAST_STEPS["cpu"])))


def refit_config(config: TrainConfig) -> TrainConfig:
    """The configuration with the rates of a refit."""
    return replace(config, scale_rate=WIDENED * config.scale_rate)
