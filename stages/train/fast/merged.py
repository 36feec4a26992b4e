"""A trainer of fewer gaussians: neighbours merged, those that no frame shows widened, since merged discs leave gaps."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import HEAD, JAW, WRISTS, J
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.fast.initial_gaussians import COLOUR_FRAMES
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.gaussians.added_alpha import added_alpha
from gsac.stages.train.gaussians.heights import level_heights
from gsac.stages.train.gaussians.merge import merge_to_size, skin_weights
from gsac.stages.train.gaussians.unseen import cover_unseen
from gsac.stages.train.task import Task
from gsac.stages.train.views import View

NEAR_JOINTS, NEAR_WEIGHT = [HEAD, *WRISTS, *range(JAW, J)], 3.0
"""Joints of head and hands, and the weight of a pixel there over one elsewhere."""


def merge_trainer(gaussians: Gaussians, seen: np.ndarray, size: int, task: Task, views: dict[int, View],
                  scale: float = 1.0) -> Trainer:
    """The gaussians merged to `size`, ready to be refitted; the body and the poses stay.

    seen: (N,) bool; views: frame -> view that tells what each gaussian is worth; scale: size that it is drawn at, of the images'.
    """
    body, rest = task.poses.body, task.poses.rest(int(task.trained[0]))[0]
    worth = count_pixels(gaussians, task, views) * viewing_weight(gaussians, body)
    fewer, seen = merge_to_size(gaussians, seen, worth, size, body, rest)
    frames = face_frames(rest, body.faces)
    trainer = Trainer(level_heights(cover_unseen(fewer, seen, frames), frames), task, frozen_body=True, scale=scale)
    trainer.seen = seen
    return trainer


def count_pixels(gaussians: Gaussians, task: Task, views: dict[int, View]) -> np.ndarray:
    """(N,) pixels that each gaussian adds to some of the trained frames."""

    def added(t: int, workspace: Workspace) -> np.ndarray:
        return added_alpha(render_bound(task.poses.vertices(t), task.poses.body.faces, gaussians, views[t].camera, workspace))

    return sum(side_by_side(added, map(int, task.trained[::-(-len(task.trained) // COLOUR_FRAMES)])), np.zeros(len(gaussians)))


def viewing_weight(gaussians: Gaussians, body: Body) -> np.ndarray:
    """(N,) weight of a gaussian's pixels, 1..NEAR_WEIGHT: viewers come closer to head and hands than the clip does."""
    return 1 + (NEAR_WEIGHT - 1) * skin_weights(gaussians.face, body)[:, NEAR_JOINTS].sum(1)
