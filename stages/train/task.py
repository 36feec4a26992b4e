"""What a recipe is handed (`Task`) and what it gives back (`Fit`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.checkpoint import State
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.gaussians.coarser import Coarser
from gsac.stages.train.gaussians.facial_features import density_on_head
from gsac.stages.train.gaussians.joint_limits import density_where_grown, find_growth
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.unseen_sides import Side, find_sides
from gsac.stages.train.views import View

LPIPS_WEIGHT = 0.01
"""Of LPIPS in the loss, or of what takes its place, in every recipe that has it there."""


@dataclass
class Task:
    views: list[View]
    """(T,) frames at the height that is trained on, each cropped to its person."""
    trained: np.ndarray
    """(n,) indices of the frames to train on."""
    choosing: np.ndarray
    """(m,) indices of frames that are not trained on: a recipe may choose by them, never fit to them."""
    poses: Poses
    """As fitted; the recipe refines those of `trained`."""
    config: TrainConfig
    progress: Callable[[int, int, str], None]
    checkpoint: Callable[..., None] = lambda step, steps, loss, gaussians, gpu_seconds=None: None
    """Called after each step with: steps done, steps in all, the step's loss, a function that returns the gaussians as they stand,
    and the seconds on the GPU so far where it runs there."""
    marks: Callable[[int], list[int]] = lambda steps: []
    """The steps, of a number of steps, after which `checkpoint` looks at gaussians and poses."""
    keep: Callable[[int, int, Callable[[], State]], None] = lambda step, steps, state: None
    """Called after `checkpoint` with: steps done, steps in all, and a function that returns the state to resume from, should the
    process die. The caller keeps the poses. Not called on the GPU, where a training takes seconds."""
    resumed: State | None = None
    """The state that a stopped run gave to `keep`; poses are as they were then."""
    filmed: Mapping[int, View] = field(default_factory=dict)
    """Frame of `choosing` -> its view, whole and as large as it was filmed, to judge by."""
    network: FeatureDistance | None = None
    """The network in the loss, where LPIPS or VGG features are wanted there and the weights are here."""
    gpu_seconds: float = 0.0
    """Seconds on the GPU before the steps: the rounds that move the poses."""

    @cached_property
    def growth(self) -> np.ndarray:
        """(F,) of `find_growth`, of the body as fitted."""
        return find_growth(self.poses, self.trained)

    @cached_property
    def density(self) -> np.ndarray:
        """(F,) factors of the density of gaussians that the body asks for, as fitted: where joints bend, and on the head."""
        return density_where_grown(self.growth) * density_on_head(self.poses.body, self.poses.betas)

    @cached_property
    def sides(self) -> list[Side]:
        """Sides that no trained frame shows, at half the size of the views."""
        camera = self.views[int(self.trained[0])].frame
        return find_sides(self.poses, self.trained, camera.scaled(max(1, camera.width // 2), max(1, camera.height // 2)))


@dataclass
class Fit:
    gaussians: Gaussians
    seen: np.ndarray
    """(N,) bool, whether training frames show the gaussian; the colour of the others is a guess."""
    gains: dict[int, np.ndarray] = field(default_factory=dict)
    """Frame -> (3,) learned gain per channel, where exposure is learned."""
    figures: dict[str, Any] = field(default_factory=dict)
    """The recipe's own entries of metrics.json."""
    smaller: list[Fit] = field(default_factory=list)
    """Smaller sizes that were tried and not taken, the largest of them first."""
    coarser: Coarser = field(default_factory=Coarser.none)
    """They may still be in the making, from the task's views."""
