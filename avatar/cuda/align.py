"""Poses alone moved to their images: one frame after the other, the gaussians as they are, over white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.cuda.recipe import Drawn, Recipe, no_rates
from gsac.avatar.cuda.trainer import CudaTrainer


@dataclass(kw_only=True)
class AlignRecipe(Recipe):
    """`steps` are those of all frames, each its share of them in one go; over it the rate falls to `pose_end` of `pose_rate`."""

    pose_end: float = 1.0


class Aligner(CudaTrainer):
    """As CudaTrainer, with one level of shots."""

    recipe: AlignRecipe

    def plan(self, levels) -> Drawn:
        recipe, steps = self.recipe, self.recipe.steps // self.frames
        order = np.repeat(np.arange(self.frames, dtype=np.int32), steps)[:, None]
        rates = no_rates(len(order))
        rates["pose"] = np.tile(recipe.pose_rate * recipe.pose_end ** (np.arange(steps) / steps), self.frames)
        return Drawn(order, np.ones((len(order), 1, 3), np.float32), rates)
