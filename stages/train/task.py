"""What a recipe is handed and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.lpips import Lpips
from gsac.stages.train.checkpoint import State
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View


@dataclass
class Task:
    views: list[View]
    """(T,) whole frames at the height that is trained on."""
    trained: np.ndarray
    """Indices of the frames to train on."""
    held: np.ndarray
    """Indices of frames that are not trained on: a recipe may choose by them, never fit to them."""
    poses: Poses
    """As fitted; the recipe refines those of `trained`."""
    config: TrainConfig
    progress: Callable[[int, int, str], None]
    checkpoint: Callable[..., None] = lambda step, steps, loss, gaussians, gpu_seconds=None: None
    """To be called after each step: steps done and in all, the step's loss, what gives the gaussians as they stand, and the time
    on the GPU so far where it runs there."""
    marks: Callable[[int], list[int]] = lambda steps: []
    """Of so many steps, those after which `checkpoint` looks at gaussians and poses."""
    keep: Callable[[int, int, Callable[[], State]], None] = lambda step, steps, state: None
    """To be called after `checkpoint`: steps done and in all, and what gives the state that `resumed` will be, should the process
    die. Poses are kept by the caller. Not on the GPU, where a training takes seconds."""
    resumed: State | None = None
    """What the recipe gave to `keep` in a run that was stopped; the poses are as they were then."""
    lpips: Lpips | None = None
    """The network that takes part in the loss (VGG), where it is wished for and the user has brought it."""
    gpu_seconds: float = 0.0
    """On the GPU before the steps: the rounds that move the poses."""


@dataclass
class Fit:
    gaussians: Gaussians
    seen: np.ndarray
    """(N,) bool, whether training frames show the gaussian; the colour of the others is a guess."""
    gains: dict[int, np.ndarray] = field(default_factory=dict)
    """Frame -> (3,) learned gain per channel, where exposure is learned."""
    figures: dict = field(default_factory=dict)
    """What the recipe has to say in metrics.json."""
    coarser: list[Gaussians] = field(default_factory=list)
    """Levels of detail with ever fewer gaussians."""


class Loop(NamedTuple):
    """The steps of recipe `fast` on one device."""

    train: Callable[[Task, int], tuple[Any, dict[int, View], dict[int, View]]]
    """As `fast.train`."""
    refit: Callable[[Task, Any, dict[int, View]], Any]
    """As `ladder.refit`."""
    learning: Callable[..., AbstractContextManager]
    """As `bundle.learning_on_cpu`."""
