"""The numbers that recipe `fast` fixes itself, on the CPU and on the GPU: steps, their shares, and rates that are no parameter."""

from __future__ import annotations

import math

from gsac.stages.train.config import FULL_SIZE, TrainConfig

STEPS = 1400
"""Steps on the CPU where none are configured."""
COARSE_SHARE = 0.15
"""Share of the steps, the first, that run at half the size; a longer training has no more of them than one of `STEPS`."""
MIDWAY = 0.3
"""Share of the steps after which the poses of all frames are corrected together once more."""
OFFSET_SHARE = 0.6
"""Share of the steps, the first, that also displace the body's surface to clothes and hair."""
OFFSET_RATE = 1e-3
"""m for each step of the surface's displacement; falls to a tenth."""
GAIN_RATE = 2e-3
"""Step of a frame's gain; falls to a tenth."""
LATE_REACH = 0.25
"""Share of `train.reach` that a gaussian may move once the surface is folded in: clothes and hair are in the gaussians by then."""


def coarse_steps(steps: int) -> int:
    """Number of steps, the first, that run at half the size."""
    return math.ceil(COARSE_SHARE * min(steps, STEPS))


def longest_axis(config: TrainConfig, count: int) -> float:
    """m, the longest axis (standard deviation at rest) that one of `count` gaussians may have: fewer must each cover more."""
    return config.largest * max(1, FULL_SIZE / count) ** 0.5
