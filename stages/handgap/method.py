"""What a method of filling is handed, and where it writes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.missing_hands import torso_length
from gsac.stages.handgap.turning_body import TurningBody, observe_body


@dataclass(frozen=True)
class Detections:
    """What the detector gave of T frames; a method leaves it as it is."""

    xy: np.ndarray  # (T, 133, 2) px
    score: np.ndarray  # (T, 133) in 0..1
    world: np.ndarray  # (T, 133, 3) m or NaN
    times: np.ndarray  # (T,) s

    @cached_property
    def body(self) -> TurningBody:
        """The turning body around the arms; both arms share it."""
        return observe_body(self.xy, self.score, self.world, self.times, torso_length(self.xy, self.score))


@dataclass(frozen=True)
class HiddenArm:
    side: str
    """`left` or `right`."""
    lost: np.ndarray  # (3, T) bool: frames in which elbow, wrist and hand are to be filled
    unsure: np.ndarray  # (3, T) bool: frames in which they cannot be learned from


@dataclass
class Filled:
    """The points with the gaps filled; a method writes all three in place."""

    xy: np.ndarray  # (T, 133, 2) px
    filled: np.ndarray  # (T, 133) bool
    drift: np.ndarray  # (T, 133) px, standard deviation of a filled point along each axis, the detector's noise left out


FillArm = Callable[[Filled, HiddenArm, Detections, HandgapConfig], None]
"""Fills one arm wherever its gaps are not too long."""
Interpolate = Callable[[np.ndarray, np.ndarray, int, int, np.ndarray], np.ndarray]
"""(segment (T, 2) px, seen (T,) bool, before, after, times (T,) s) -> the segment (after - before - 1, 2) px in the frames between
the seen frames `before` and `after`."""
