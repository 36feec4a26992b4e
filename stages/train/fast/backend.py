"""What recipe `fast` asks of a device: `cpu.Cpu` and `cuda.Cuda` are the two that there are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from typing import NamedTuple

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.fast.refit import Pace
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.poses.bundle_adjust import Equations
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import View, Views


class Trained(NamedTuple):
    trainer: Trainer
    """Holds the trained gaussians and gains, on the CPU."""
    fine: dict[int, View]
    """Trained frame -> its view, cropped to the person."""
    coarse: dict[int, View]
    """The same at half the size."""


class Round(NamedTuple):
    frames: np.ndarray
    """(n,) indices in the clip, in the order of the steps."""
    backgrounds: np.ndarray
    """(n, 3) in 0..1, one a step."""
    done: float
    """Share of a training's steps whose rates the round has."""


class Rounds(ABC):
    """Gaussians and the body's surface that learn a round at a time; in between the caller moves the poses."""

    face: np.ndarray
    """(N,) index of each gaussian's face."""

    @abstractmethod
    def learn(self, number: int) -> None:
        """Does the steps of a round of the plan, with the poses as the task has them now."""

    @abstractmethod
    def gaussians(self) -> Gaussians:
        """The gaussians as they stand."""


class Backend(ABC):
    """The optimisations of recipe `fast` on one kind of device. Numbers that are not finite raise StageError with the step."""

    device: str
    """cpu or cuda."""

    @abstractmethod
    def train(self, task: Task, count: int) -> Trained:
        """Fits `count` gaussians to the trained frames; refines their poses in task.poses."""

    @abstractmethod
    def refit(self, task: Task, trainer: Trainer, views: dict[int, View], pace: Pace,
              coarse: dict[int, View] | None = None) -> Trainer:
        """Fits merged gaussians anew at a pace; poses and unseen gaussians stay.

        views: trained frame -> view; coarse: the same at half the size for the first steps, where they shall be coarse: then sides
        that no frame shows are looked at, too.
        """

    @abstractmethod
    def open_rounds(self, task: Task, views: dict[int, View], gaussians: Gaussians,
                    plan: list[Round]) -> AbstractContextManager[Rounds]:
        """A context in which the gaussians learn by the plan while someone else moves task.poses. views: trained frame -> view."""

    @abstractmethod
    def open_equations(self, task: Task, gaussians: Gaussians, views: dict[int, View]) -> AbstractContextManager[Equations]:
        """A context that has the normal equations of task.poses in the views, frame -> view, for these gaussians as they learn."""

    @abstractmethod
    def align_poses(self, gaussians: Gaussians, poses: Poses, frames: np.ndarray, views: Views, steps: int) -> None:
        """Test-time pose optimisation: moves the poses of `frames`, (n,) indices, to their images; the avatar stays.

        views: frame -> view; steps: for each frame.
        """

    def fit(self, task: Task, count: int) -> Fit:
        """`train`, with its result as a recipe hands it out."""
        trainer, _, coarse = self.train(task, count)
        return Fit(*trainer.finish(coarse), dict(trainer.gains))
