"""Poses of all frames moved to the images before the training: few gaussians on small images, poses by Gauss-Newton.

Rounds of two: the gaussians and the surface learn from the frames as they are posed; then the corrections of all frames
are solved together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, contextmanager
from typing import NamedTuple

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.fast import trainer as fast
from gsac.stages.train.poses.bundle_adjust import Corrections, apart
from gsac.stages.train.task import Task
from gsac.stages.train.views import View

COUNT = 3000
"""Gaussians, at most as many as are asked for."""
LEAST_HEIGHT = 90
"""px of the largest crop; images are halved as long as that leaves this much, at most twice."""
EPOCHS = 2
"""Steps of a frame's appearance in a round."""
DONE = 0.6
"""Rates of the last round are those of a training after this share of its steps."""


class Round(NamedTuple):
    frames: np.ndarray
    """(n,) in the order of the steps."""
    backgrounds: np.ndarray
    """(n, 3)."""
    done: float
    """Share of a training's steps that the rates are those of."""


def adjust(task: Task, learning: Callable[..., AbstractContextManager]) -> None:
    """Corrects the poses of all frames in task.poses, and leaves the surface's offset there, for `fast.start`.

    Views that are far from each other, as photos are, show hardly a surface together: their poses stay.
    learning: where gaussians and surface learn, as `learning_on_cpu`.
    """
    config, rounds = task.config, task.config.pose_rounds
    if not rounds or apart(task.poses.fit_pose[task.trained, 0]):
        return
    views = small(task)
    count = COUNT if isinstance(config.gaussians, str) else min(COUNT, config.gaussians)
    plan = drawn(list(views), rounds, np.random.default_rng([config.seed, 1]))
    with learning(task, views, fast.start(task, views, count), plan) as (learn, gaussians, face):
        corrections = Corrections(task.poses, gaussians, face, views)
        for number in range(rounds):
            learn(plan[number])
            corrections.solve()
            task.progress(number + 1, rounds, "rounds of poses")
    task.poses.settle()


def drawn(frames: list[int], rounds: int, rng: np.random.Generator) -> list[Round]:
    out = []
    for number in range(rounds):
        order = np.concatenate([rng.permutation(frames) for _ in range(EPOCHS)])
        out.append(Round(order, rng.random((len(order), 3)), DONE * number / rounds))
    return out


@contextmanager
def learning_on_cpu(task: Task, views: dict[int, View], gaussians: Gaussians, plan: list[Round]):
    """`learn(round)` with the poses as they are in the task; the gaussians as they stand, `gaussians()`; their faces."""
    trainer = fast.Trainer(gaussians, task)
    trainer.pose_rate = 0.0

    def learn(one: Round) -> None:
        for step, (t, background) in enumerate(zip(one.frames, one.backgrounds, strict=True)):
            trainer.step(int(t), views[int(t)], one.done, background, step)

    yield learn, trainer.gaussians, trainer.face


def small(task: Task) -> dict[int, View]:
    """The trained frames, cut to the person, at a quarter of the size."""
    views = {int(t): fast.person_crop(task.views[t]) for t in task.trained}
    for _ in range(2):
        if max(view.camera.height for view in views.values()) < 2 * LEAST_HEIGHT:
            break
        views = {t: view.halved() for t, view in views.items()}
    return views
