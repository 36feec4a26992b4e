"""Recipe `fast` on the CPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.threads import side_by_side
from gsac.stages.train.checkpoint import loop_state
from gsac.stages.train.config import FAST_STEPS, coarse_share, coarse_steps
from gsac.stages.train.fast.backend import Backend, Round, Rounds, Trained
from gsac.stages.train.fast.initial_gaussians import crop_views, init_gaussians
from gsac.stages.train.fast.refit import Pace, refit_config, refit_steps
from gsac.stages.train.fast.schedule import MIDWAY, OFFSET_SHARE, person_pixels
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.judge.heldout import align_pose
from gsac.stages.train.poses.bundle_adjust import correct_midway
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, Views, of_each


class Cpu(Backend):
    """Every step by `Trainer.step`."""

    device = "cpu"

    def train(self, task: Task, count: int) -> Trained:
        """As `Backend.train`; keeps checkpoints, and goes on from task.resumed where there is one."""
        config = task.config
        rng = np.random.default_rng(config.seed)
        fine = crop_views(task)
        coarse = of_each(View.halved, fine)
        steps = config.steps or FAST_STEPS[self.device]
        coarse_until = coarse_steps(person_pixels(task), steps)
        order: list[int] = []
        if task.resumed is None:
            trainer, first = Trainer(init_gaussians(task, coarse, count), task), 0
        else:
            trainer, first = Trainer.from_state(task.resumed["trainer"], task), task.resumed["step"]
            order, rng.bit_generator.state = task.resumed["order"], task.resumed["rng"]
            task.resumed = None
        midway = round(MIDWAY * steps) if config.pose_rounds else -1
        for step in range(first, steps):
            if step == midway:
                correct_midway(task.poses, task.trained, trainer.gaussians, trainer.face, coarse if step < coarse_until else fine)
            if not order:
                order = [int(t) for t in rng.permutation(task.trained)]
            t, done = order.pop(), step / steps
            if trainer.offsets and done >= OFFSET_SHARE:
                trainer.fold_offsets()
                trainer.lay_unseen(coarse)
            loss = trainer.step(t, (coarse if step < coarse_until else fine)[t], done, rng.random(3), step)
            task.checkpoint(step + 1, steps, loss, trainer.gaussians)
            task.keep(step + 1, steps, partial(loop_state, step + 1, order, rng, trainer))
            task.progress(step + 1, steps, "steps")
        if trainer.offsets:
            trainer.fold_offsets()
            trainer.lay_unseen(coarse)
        return Trained(trainer, fine, coarse)

    def refit(self, task: Task, trainer: Trainer, views: dict[int, View], pace: Pace,
              coarse: dict[int, View] | None = None) -> Trainer:
        """As `Backend.refit`, in the trainer itself."""
        rng = np.random.default_rng(task.config.seed)
        trainer.config = refit_config(task.config, pace)
        order: list[int] = []
        steps = refit_steps(task.config, pace)
        averaged = max(1, round(pace.averaged * steps))
        coarse_until = round(coarse_share(person_pixels(task)) * steps) if coarse else 0
        sums = {name: np.zeros(value.shape) for name, value in trainer.values.items()}
        for step in range(steps):
            order = order or [int(t) for t in rng.permutation(task.trained)]
            t = order.pop()
            shown = coarse if coarse and step < coarse_until else views
            trainer.step(t, shown[t], pace.begin + (1 - pace.begin) * step / steps, rng.random(3), step)
            if step >= steps - averaged:
                for name, value in trainer.values.items():
                    sums[name] += value
        trainer.values = {name: (total / averaged).astype(np.float32) for name, total in sums.items()}
        return trainer

    @contextmanager
    def open_rounds(self, task: Task, views: dict[int, View], gaussians: Gaussians, plan: list[Round]) -> Iterator[Rounds]:
        """As `Backend.open_rounds`."""
        yield CpuRounds(task, views, gaussians, plan)

    def align_poses(self, gaussians: Gaussians, poses: Poses, frames: np.ndarray, views: Views, steps: int) -> None:
        """As `Backend.align_poses`. frames: (n,)."""
        side_by_side(lambda t, workspace: align_pose(gaussians, poses, t, views[t], steps, workspace), map(int, frames))


class CpuRounds(Rounds):
    """A Trainer whose poses stay where the task has them."""

    def __init__(self, task: Task, views: dict[int, View], gaussians: Gaussians, plan: list[Round]):
        self._trainer, self._views, self._plan = Trainer(gaussians, task), views, plan
        self._trainer.pose_rate = 0.0
        self.face = self._trainer.face

    def learn(self, number: int) -> None:
        frames, backgrounds, done = self._plan[number]
        for step, (t, background) in enumerate(zip(frames, backgrounds, strict=True)):
            self._trainer.step(int(t), self._views[int(t)], done, background, step)

    def gaussians(self) -> Gaussians:
        return self._trainer.gaussians()
