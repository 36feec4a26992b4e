"""Recipe `paper` on the GPU: `trainer.fit` with its steps inside `PaperTrainer`; frames and backgrounds come in another order."""

from __future__ import annotations

import numpy as np

from gsac.avatar.cuda.paper import PaperGaussians, PaperRecipe, PaperTrainer
from gsac.avatar.logistic import sigmoid
from gsac.stages.train.gpu import LPIPS_STEPS, hand_back, open_trainer, train_until
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.paper.densify import LARGEST, Densifier, due
from gsac.stages.train.paper.knn import RENEW
from gsac.stages.train.poses.poses import HAND_SHARE
from gsac.stages.train.task import LPIPS_WEIGHT, Fit, Task
from gsac.stages.train.views import person_crop


def fit(task: Task) -> Fit:
    """As `trainer.fit`. Raises StageError also where the GPU fails."""
    rng, recipe = np.random.default_rng(task.config.seed), make_recipe(task)
    gaussians = init_gaussians(len(task.poses.body.faces), rng)
    densifier = Densifier(len(gaussians))
    views = {int(t): person_crop(task.views[t]) for t in task.trained}
    with open_trainer(PaperTrainer, task.poses, task.trained, [views], gaussians, recipe, task.lpips) as trainer:
        for event in filter(due, range(recipe.steps)):
            train_until(trainer, task, event + 1)
            densifier.length, densifier.hits = trainer.pulls()
            densifier.grow(event, GpuGaussians(trainer), rng)
        train_until(trainer, task, recipe.steps)
        hand_back(trainer, task)
        found = trainer.gaussians()
    return Fit(found, np.ones(len(found), bool))


def make_recipe(task: Task) -> PaperRecipe:
    """The published rates and weights for the task's frames."""
    camera = task.views[0].frame
    return PaperRecipe(
        steps=task.config.steps or paper.STEPS, batch=min(paper.BATCH, len(task.trained)), seed=task.config.seed,
        mu_rate=paper.MU_RATE, mu_decay=paper.MU_DECAY, rgb_rate=paper.RATES["rgb"], quat_rate=paper.RATES["quat"],
        scale_rate=paper.RATES["scale_logit"], pose_rate=paper.POSE_RATE, beta_rate=paper.POSE_RATE, hand_share=HAND_SHARE,
        ssim=paper.SSIM, edges=paper.SOBEL, dice=paper.DICE, knn=paper.KNN, scale_limit=LARGEST,
        frame_size=(camera.width, camera.height), renew=RENEW, perceptual=LPIPS_WEIGHT, perceptual_steps=LPIPS_STEPS)


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
