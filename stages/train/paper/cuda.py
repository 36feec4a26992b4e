"""Recipe `paper` on the GPU: `trainer.fit` with its steps inside `PaperTrainer`, on the same frames and backgrounds."""

from __future__ import annotations

import numpy as np

from gsac.avatar.cuda.paper import PaperGaussians, PaperRecipe, PaperTrainer
from gsac.avatar.logistic import sigmoid
from gsac.stages.train.gpu import hand_back, open_trainer, train_until
from gsac.stages.train.paper import body_adam, densify, losses
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.paper.square import side_of
from gsac.stages.train.poses.poses import HAND_SHARE
from gsac.stages.train.task import LPIPS_WEIGHT, Fit, Task


def fit(task: Task) -> Fit:
    """As `trainer.fit`. Raises StageError also where the GPU fails."""
    rng, recipe = np.random.default_rng(task.config.seed), make_recipe(task)
    gaussians = init_gaussians(len(task.poses.body.faces), rng)
    densifier, views = densify.Densifier(len(gaussians)), paper.crop_views(task)
    with open_trainer(PaperTrainer, task.poses, task.trained, [views], gaussians, recipe, task.network) as trainer:
        for event in filter(densify.due, range(recipe.steps)):
            train_until(trainer, task, event + 1)
            densifier.length, densifier.hits = trainer.pulls()
            densifier.grow(event, GpuGaussians(trainer), rng)
        train_until(trainer, task, recipe.steps)
        hand_back(trainer, task)
        found = trainer.gaussians()
    return Fit(found, np.ones(len(found), bool))


def make_recipe(task: Task) -> PaperRecipe:
    """The published rates and weights for the task's frames, and what its steps see."""
    side, batches, text = side_of(task.views), paper.plan_batches(task), task.config.paper_text
    steps, batch = batches.order.shape
    return PaperRecipe(
        steps=steps, batch=batch, seed=task.config.seed, order=batches.order, background=batches.background, centre=batches.centre,
        mu_rates=paper.mu_rates(steps), counts=np.array([densify.counts(step) for step in range(steps)]),
        rgb_rate=paper.RATES["rgb"], quat_rate=paper.RATES["quat"], scale_rate=paper.RATES["scale_logit"],
        pose_rate=body_adam.RATE, beta_rate=body_adam.RATE, expression_rate=HAND_SHARE * body_adam.RATE, hand_share=HAND_SHARE,
        jaw_share=HAND_SHARE, fresh=body_adam.FRESH, tiny=body_adam.TINY, masked=not text, ssim=losses.SSIM,
        sobel=losses.TEXT_SOBEL * losses.SOBEL if text else 0.0, edges=0.0 if text else losses.SOBEL,
        dice=0.0 if text else losses.DICE, knn=paper.KNN, scale_limit=densify.LARGEST, frame_size=(side, side),
        perceptual=LPIPS_WEIGHT, perceptual_steps=steps)


def init_gaussians(count: int, rng: np.random.Generator) -> PaperGaussians:
    """One gaussian on each of `count` faces, in random colours."""
    opacity = sigmoid(paper.OPACITY_LOGIT)
    return PaperGaussians(np.arange(count, dtype=np.int32), np.zeros((count, 3), np.float32),
                          np.tile(np.float32([1, 0, 0, 0]), (count, 1)), np.tile(np.float32(paper.SCALE_LOGITS), (count, 1)),
                          rng.random((count, 3)).astype(np.float32), np.full(count, opacity, np.float32))


class GpuGaussians:
    """The trainer's gaussians for a Densifier (`densify.Growable`)."""

    def __init__(self, trainer: PaperTrainer):
        self.trainer, self.values, self.face = trainer, trainer.values(), trainer.face

    def append(self, parents: np.ndarray, new: dict[str, np.ndarray]) -> None:
        """parents: (n,) indices; new: name -> (n, C) rows."""
        self.face = np.concatenate([self.face, self.face[parents]])
        self.trainer.grow(self.face, {name: np.concatenate([self.values[name], rows]) for name, rows in new.items()})
