"""Recipe `paper` on the GPU: `paper.fit` with its steps inside `PaperTrainer`; frames and backgrounds come in another order."""

from __future__ import annotations

import numpy as np

from gsac.avatar.cuda.paper import PaperRecipe, PaperTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import sigmoid
from gsac.stages.train.fast.cuda import PERCEPTUAL_STEPS, follow, hand_back, training
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.paper.densify import LARGEST, Densifier, due
from gsac.stages.train.paper.knn import RENEW
from gsac.stages.train.poses.poses import HAND_SHARE
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import person_crop


def fit(task: Task) -> Fit:
    """As `paper.fit`. Raises StageError also where the GPU fails."""
    rng, recipe = np.random.default_rng(task.config.seed), recipe_of(task)
    gaussians = start(len(task.poses.body.faces), rng)
    densifier = Densifier(len(gaussians))
    views = {int(t): person_crop(task.views[t]) for t in task.trained}
    with training(task.poses, task.trained, [views], gaussians, recipe, PaperTrainer, task.lpips) as trainer:
        for event in filter(due, range(recipe.steps)):
            follow(trainer, task, event + 1)
            densifier.length, densifier.hits = trainer.pulls()
            densifier.after(event, Growing(trainer), rng)
        follow(trainer, task, recipe.steps)
        hand_back(trainer, task)
        gaussians = trainer.gaussians()
    return Fit(gaussians, np.ones(len(gaussians), bool))


def recipe_of(task: Task) -> PaperRecipe:
    camera = task.views[0].camera
    return PaperRecipe(
        steps=task.config.steps or paper.STEPS, batch=min(paper.BATCH, len(task.trained)), seed=task.config.seed,
        mu_rate=paper.MU_RATE, mu_decay=paper.MU_DECAY, rgb_rate=paper.RATES["rgb"], quat_rate=paper.RATES["quat"],
        scale_rate=paper.RATES["scale"], pose_rate=paper.POSE_RATE, beta_rate=paper.POSE_RATE, hand_share=HAND_SHARE,
        ssim=paper.SSIM, edges=paper.SOBEL, dice=paper.DICE, knn=paper.KNN, scale_limit=LARGEST,
        frame_size=(camera.width, camera.height), renew=RENEW, perceptual=paper.LPIPS, perceptual_steps=PERCEPTUAL_STEPS)


def start(count: int, rng: np.random.Generator) -> Gaussians:
    """One gaussian a face, colours from noise; `log_scale` holds logits."""
    opacity = sigmoid(paper.OPACITY_LOGIT)
    return Gaussians(np.arange(count, dtype=np.int32), np.zeros((count, 3), np.float32),
                     np.tile(np.float32([1, 0, 0, 0]), (count, 1)), np.tile(np.float32(paper.SCALE_LOGITS), (count, 1)),
                     rng.random((count, 3)).astype(np.float32), np.full(count, opacity, np.float32))


class Growing:
    """The trainer's gaussians as a Densifier grows them."""

    def __init__(self, trainer: PaperTrainer):
        self.trainer, self.values, self.face = trainer, trainer.values(), trainer.face

    def append(self, parents: np.ndarray, new: dict[str, np.ndarray]) -> None:
        self.face = np.concatenate([self.face, self.face[parents]])
        self.trainer.grow(self.face, {name: np.concatenate([self.values[name], rows]) for name, rows in new.items()})
