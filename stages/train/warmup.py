"""Warm-up: a training in miniature that compiles or loads the CPU kernels of recipe `fast` before the real one needs them."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.gaussians.merge import merge_to_size
from gsac.stages.train.judge.heldout import judge
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.recipes import BACKENDS, RECIPES
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, cut_out_bytes

FRAMES, STEPS, GAUSSIANS = 3, 6, 330
WIDTH, HEIGHT, FOCAL, DISTANCE = 54, 96, 150.0, 3.2
"""px and m: images that the body nearly fills."""
TURN = 0.2
"""rad, the body's turn from frame to frame."""


def warm_up() -> None:
    """Takes some fifteen seconds the very first time, when everything is compiled; one second from the compiler's cache."""
    body = Body.load()
    pose = np.zeros((FRAMES, len(body.parents), 3))
    for t in range(FRAMES):
        pose[t, 0] = np.pi * np.array([np.cos(t * TURN / 2), 0, np.sin(t * TURN / 2)])
    params = BodyParams.from_pose(pose, np.tile([0.0, 0.0, DISTANCE], (FRAMES, 1)), np.zeros(4),
                                  np.zeros((FRAMES, body.exprdirs.shape[2])), FOCAL, (WIDTH / 2, HEIGHT / 2), model=body.digest)
    pixels = cut_out_bytes(np.full((HEIGHT, WIDTH, 3), 255, np.uint8), np.ones((HEIGHT, WIDTH), np.float32))
    views = [View(Camera((FOCAL, FOCAL), (WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT), pixels, (0, 0)) for _ in range(FRAMES)]
    frames, poses = np.arange(FRAMES), Poses(body, params)
    config = TrainConfig(gaussians=GAUSSIANS, steps=STEPS, pose_rounds=1)
    gaussians = RECIPES["fast", "cpu"](Task(views, frames, frames[:1], poses, config, lambda done, total, unit: None)).gaussians
    shown = np.ones(len(gaussians))
    merge_to_size(gaussians, shown > 0, shown, len(gaussians) // 2, body, poses.rest(0)[0])
    converge(gaussians, poses, frames[:1], views, 1)
    BACKENDS["cpu"].align_poses(gaussians, poses, frames[:1], views, 1)
    judge(gaussians, poses, frames[:1], views)
    poses.to_params()
