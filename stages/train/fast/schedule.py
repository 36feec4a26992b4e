"""The numbers that recipe `fast` fixes itself, on the CPU and on the GPU: steps, their shares, and rates that are no parameter."""

from __future__ import annotations

import math

import numpy as np

from gsac.stages.train.config import FULL_SIZE, TrainConfig
from gsac.stages.train.task import Task

STEPS = 1200
"""Steps on the CPU where none are configured."""
SMALL, LARGE = (3e4, 0.15), (1.6e5, 0.8)
"""Pixels of a person in a frame, and the share of the steps, the first, that run at half the size: small images are cheap, large
ones have little that half the size does not show. A longer training has no more of these steps than one of `STEPS`."""
SIZES = 3000, 30000
"""Least and most gaussians where none are asked for: `FULL_SIZE` for a person of `LARGE`, half as many for a quarter of it."""
MORE_ON_CUDA = 1.5
"""Factor on them on the GPU, where they cost least."""
MIDWAY = 0.3
"""Share of the steps after which the poses of all frames are corrected together once more."""
OFFSET_SHARE = 0.6
"""Share of the steps, the first, that also displace the body's surface to clothes and hair."""
OFFSET_RATE = 1e-3
"""m for each step of the surface's displacement; falls to a tenth."""
GAIN_RATE = 2e-3
"""Step of a frame's gain; falls to a tenth."""
MU_END, END = 0.03, 0.3
"""What the rates of places, and of all else of a gaussian, fall to."""
FINEST = 0.4
"""px of the frames, the shortest axis of a gaussian, about that of a pixel: from near, nothing finer shows."""
LATE_REACH = 0.25
"""Share of `train.reach` that a gaussian may move once the surface is folded in: clothes and hair are in the gaussians by then."""


def coarse_share(task: Task) -> float:
    """Share of the steps, the first, that run at half the size."""
    (small, least), (large, most) = SMALL, LARGE
    part = math.log(max(person_pixels(task), 1) / small) / math.log(large / small)
    return least + (most - least) * min(max(part, 0.0), 1.0)


def coarse_steps(task: Task, steps: int) -> int:
    """Number of steps, of `steps`, that run at half the size."""
    return math.ceil(coarse_share(task) * min(steps, STEPS))


def budget(task: Task, device: str) -> int:
    """Gaussians: as many as asked for, or those that the size search starts from on `device` (cpu, cuda)."""
    if isinstance(task.config.gaussians, int):
        return task.config.gaussians
    more = MORE_ON_CUDA if device == "cuda" else 1.0
    return round(min(max(more * FULL_SIZE * (person_pixels(task) / LARGE[0]) ** 0.5, SIZES[0]), SIZES[1]), -3)


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
