"""Rounds of steps with fixed poses: gaussians and surface learn; between rounds the caller moves the poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gsac.avatar.cuda.recipe import DrawnPlan, Recipe, rates_of
from gsac.avatar.cuda.trainer import CudaTrainer


class Round(NamedTuple):
    frames: np.ndarray
    """(n,) indices of the trainer's frames, in the order of the steps."""
    backgrounds: np.ndarray
    """(n, 3) in 0..1."""
    done: float
    """Share of a training's steps whose rates the round has."""


@dataclass(kw_only=True)
class RoundsRecipe(Recipe):
    rounds: list[Round] = field(default_factory=list)


class RoundsTrainer(CudaTrainer):
    """As CudaTrainer, with one level of shots; the recipe's `steps` are those of all rounds."""

    recipe: RoundsRecipe

    def plan(self, levels: int) -> DrawnPlan:
        """As `CudaTrainer.plan`: the recipe's rounds."""
        rounds = self.recipe.rounds
        done = np.repeat([r.done for r in rounds], [len(r.frames) for r in rounds])
        return DrawnPlan(np.concatenate([r.frames for r in rounds]).astype(np.int32)[:, None],
                     np.concatenate([r.backgrounds for r in rounds]).astype(np.float32)[:, None], rates_of(self.recipe, done))
