"""The numbers that recipe `fast` fixes itself, on the CPU and on the GPU: shares of the steps, and rates that are no parameter."""

from __future__ import annotations

import numpy as np

from gsac.stages.train.config import FULL_SIZE, TrainConfig, asked_size
from gsac.stages.train.task import Task

MIDWAY = 0.3
"""Share of the steps after which the poses of all frames are corrected together once more."""
LATE = {"cpu": (0.36, 0.48, 0.6, 0.72), "cuda": (0.45, 0.6, 0.75)}
"""Shares of the steps after which each frame's own error is taken out of its pose, by device: of more steps Adam takes out more."""
OFFSET_SHARE = 0.6
"""Share of the steps, the first, that also displace the body's surface to clothes and hair."""
OFFSET_RATE = 1e-3
"""m for each step of the surface's displacement; falls to a tenth."""
GAIN_RATE = 2e-3
"""Step of a frame's gain; falls to a tenth."""
AVERAGED = {"cpu": 0.1, "cuda": 0.2}
"""Share of the steps, the last, whose gaussians are averaged, by device: of the CPU's fewer steps more are too old."""
MU_END, END = 0.03, 0.3
"""What the rates of places, and of all else of a gaussian, fall to."""
FINEST = 0.4
"""px of the frames, the shortest axis of a gaussian, about that of a pixel: from near, nothing finer shows."""
LATE_REACH = 0.25
"""Share of `train.reach` that a gaussian may move once the surface is folded in: clothes and hair are in the gaussians by then."""


def correction_steps(config: TrainConfig, steps: int, device: str, multiple: int = 1) -> list[int]:
    """Steps before which Gauss-Newton corrects the poses: first those of all frames together, from then on each by itself.

    device: cpu or cuda; multiple: of which they are.
    """
    shares = (MIDWAY, *LATE[device]) if config.pose_rounds else ()
    return [round(share * steps) // multiple * multiple for share in shares]


def averaged_from(steps: int, device: str) -> int:
    """The step, from 0, from which on the gaussians are averaged: at least the last one is. device: cpu or cuda."""
    return min(round((1 - AVERAGED[device]) * steps), steps - 1)


def budget(task: Task, device: str) -> int:
    """Gaussians: as many as asked for, or those that the size search starts from on `device` (cpu, cuda)."""
    asked = task.config.gaussians
    return asked if isinstance(asked, int) else asked_size(person_pixels(task), device)


def person_pixels(task: Task) -> float:
    """Pixels of the person in a frame that is trained on, median."""
    return float(np.median([np.count_nonzero(task.views[int(t)].pixels[..., 3] > 127) for t in task.trained]))


def longest_axis(config: TrainConfig, count: int) -> float:
    """m, the longest axis (standard deviation at rest) that one of `count` gaussians may have: fewer must each cover more."""
    return config.largest * max(1, FULL_SIZE / count) ** 0.5


def shortest_axis(task: Task, scale: float = 1.0) -> float:
    """m, the shortest axis (standard deviation at rest) that a gaussian may have: the frames tell nothing finer.

    scale: size that the gaussians are drawn at, of the frames'.
    """
    depth = float(np.median(task.poses.fit_transl[task.trained, 2]))
    return FINEST / scale * depth / min(task.views[0].camera.focal)
