"""Pose alignment before the training: moves the poses of all frames to small images with few gaussians, by Gauss-Newton.

A round has two halves: gaussians and surface learn with the poses as they are; then the corrections of all frames are solved
together.
"""

from __future__ import annotations

import numpy as np

from gsac.stages.train.fast.backend import Backend, Round
from gsac.stages.train.fast.initial_gaussians import crop_views, init_gaussians
from gsac.stages.train.fast.schedule import budget
from gsac.stages.train.poses.bundle_adjust import Corrections, are_apart
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, of_each

COUNT = 3000
"""Gaussians, at most as many as are asked for."""
LEAST_HEIGHT = 90
"""px, least height of the largest crop; images are halved as long as it keeps that height, at most twice."""
EPOCHS = 2
"""Steps on each frame in a round."""
DONE = 0.6
"""Rates of the last round are those of a training after this share of its steps."""


def adjust(task: Task, backend: Backend) -> None:
    """Corrects the poses of all frames in task.poses, and leaves the surface's offset there, for `start.init_gaussians`.

    Poses stay where views are far from each other, as photos are: they share hardly any surface.
    """
    config, rounds = task.config, task.config.pose_rounds
    if not rounds or are_apart(task.poses.fit_pose[task.trained, 0]):
        return
    views = shrink_views(task)
    count = min(COUNT, budget(task, backend.device))
    plan = draw_rounds(list(views), rounds, np.random.default_rng([config.seed, 1]))
    gaussians = init_gaussians(task, views, count)
    with backend.open_rounds(task, views, gaussians, plan) as learned, backend.open_equations(task, gaussians, views) as equations:
        corrections = Corrections(task.poses, learned.gaussians, equations)
        for number in range(rounds):
            learned.learn(number)
            corrections.solve()
            task.progress(number + 1, rounds, "rounds of poses")
    task.poses.settle()


def draw_rounds(frames: list[int], rounds: int, rng: np.random.Generator) -> list[Round]:
    """The plan: for each round its frames, shuffled anew in every epoch, its backgrounds and its rates."""
    out = []
    for number in range(rounds):
        order = np.concatenate([rng.permutation(frames) for _ in range(EPOCHS)])
        out.append(Round(order, rng.random((len(order), 3)), DONE * number / rounds))
    return out


def shrink_views(task: Task) -> dict[int, View]:
    """The trained frames, cropped to the person, at a quarter of the size or as small as `LEAST_HEIGHT` allows."""
    views = crop_views(task)
    for _ in range(2):
        if max(view.camera.height for view in views.values()) < 2 * LEAST_HEIGHT:
            break
        views = of_each(View.halved, views)
    return views
