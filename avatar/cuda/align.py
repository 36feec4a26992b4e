"""Aligns poses alone to their images: one frame after the other, the gaussians held still, over white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.cuda.recipe import DrawnPlan, Recipe, zero_rates
from gsac.avatar.cuda.trainer import CudaTrainer


@dataclass(kw_only=True)
class AlignRecipe(Recipe):
    """`steps` are those of all frames; each frame has its share in one go, over which the rate falls to `pose_end` of it."""

    pose_end: float = 1.0


class Aligner(CudaTrainer):
    """As CudaTrainer, with one level of shots."""

    recipe: AlignRecipe

    def plan(self, levels: int) -> DrawnPlan:
        """As `CudaTrainer.plan`: each frame's steps after one another."""
        recipe, steps = self.recipe, self.recipe.steps // self.frames
        order = np.repeat(np.arange(self.frames, dtype=np.int32), steps)[:, None]
        rates = zero_rates(len(order))
        rates["pose"] = np.tile(recipe.pose_rate * recipe.pose_end ** (np.arange(steps) / steps), self.frames)
        return DrawnPlan(order, np.ones((len(order), 1, 3), np.float32), rates)
