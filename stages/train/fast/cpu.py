"""Recipe `fast` on the CPU: as many steps side by side as `Trainer.learn` takes."""

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
from gsac.stages.train.fast.schedule import OFFSET_SHARE, averaged_from, correction_steps, person_pixels
from gsac.stages.train.fast.trainer import AT_ONCE, Step, Trainer
from gsac.stages.train.gaussians.mean_of_steps import MeanOfSteps
from gsac.stages.train.judge.heldout import align_pose
from gsac.stages.train.poses.bundle_adjust import Equations, FrameEquations, correct_midway
from gsac.stages.train.poses.expressions import correct_expressions
from gsac.stages.train.poses.own_errors import correct_each, newton_steps
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.unseen_sides import Side, side_at
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, Views, of_each


class Draws:
    """What each step is made on, and over which colour: frames in rounds, every one once a round, and sides in between."""

    def __init__(self, task: Task, sides: list[Side]):
        self.trained, self.sides = task.trained, sides
        self.rng = np.random.default_rng(task.config.seed)
        self.order: list[int] = []
        """Frames still to come in this round."""

    def step(self, number: int, done: float, views: dict[int, View]) -> Step:
        """The next step. done: share of the training that its rates have behind them; views: frame -> view."""
        at = side_at(number, done, len(self.sides))
        if at is not None:
            t, turn, view = self.sides[at]
            return Step(t, view, done, self.rng.random(3), number, turn)
        self.order = self.order or [int(t) for t in self.rng.permutation(self.trained)]
        t = self.order.pop()
        return Step(t, views[t], done, self.rng.random(3), number)


class Cpu(Backend):
    """Every step by `Trainer.learn`."""

    device = "cpu"

    def train(self, task: Task, count: int) -> Trained:
        """As `Backend.train`; keeps checkpoints, and goes on from task.resumed where there is one.

        What changes midway does so before the first step, of those side by side, that is due.
        """
        config = task.config
        draws = Draws(task, task.sides)
        fine = crop_views(task)
        coarse = of_each(View.halved, fine)
        steps = config.steps or FAST_STEPS[self.device]
        coarse_until = coarse_steps(person_pixels(task), steps)
        mean = MeanOfSteps()
        if task.resumed is None:
            trainer, first = Trainer(init_gaussians(task, coarse, count), task), 0
        else:
            trainer, first = Trainer.from_state(task.resumed["trainer"], task), task.resumed["step"]
            draws.order, draws.rng.bit_generator.state = task.resumed["order"], task.resumed["rng"]
            mean.restore(task.resumed["mean"])
            task.resumed = None
        corrections, mean_from = correction_steps(config, steps, self.device, AT_ONCE), averaged_from(steps, self.device)
        for step in range(first, steps, AT_ONCE):
            if step in corrections:
                self.correct(task, trainer, coarse if step < coarse_until else fine, together=step == corrections[0])
            if trainer.offsets and step / steps >= OFFSET_SHARE:
                trainer.fold_offsets()
                trainer.lay_unseen(coarse)
            these = [draws.step(number, number / steps, coarse if number < coarse_until else fine)
                     for number in range(step, min(step + AT_ONCE, steps))]
            for done, loss in enumerate(trainer.learn(these), step + 1):
                task.checkpoint(done, steps, loss, trainer.gaussians)
            done = step + len(these)
            if done > mean_from:
                mean.add(trainer.values)
            task.keep(done, steps, partial(loop_state, done, draws.order, draws.rng, trainer, mean))
            task.progress(done, steps, "steps")
        trainer.values = mean.values()
        if trainer.offsets:
            trainer.fold_offsets()
            trainer.lay_unseen(coarse)
        trainer.free_buffers()
        return Trained(trainer, fine, coarse)

    def refit(self, task: Task, trainer: Trainer, views: dict[int, View], pace: Pace,
              coarse: dict[int, View] | None = None) -> Trainer:
        """As `Backend.refit`, in the trainer itself."""
        draws = Draws(task, task.sides if coarse else [])
        trainer.config = refit_config(task.config, pace)
        steps = refit_steps(task.config, pace)
        averaged, mean = max(1, round(pace.averaged * steps / AT_ONCE)), MeanOfSteps()
        coarse_until = round(coarse_share(person_pixels(task)) * steps) if coarse else 0
        begins = range(0, steps, AT_ONCE)
        for begin in begins:
            trainer.learn([draws.step(number, pace.begin + (1 - pace.begin) * number / steps,
                                      coarse if coarse and number < coarse_until else views)
                           for number in range(begin, min(begin + AT_ONCE, steps))])
            if begin in begins[-averaged:]:
                mean.add(trainer.values)
        trainer.free_buffers()
        trainer.values = mean.values()
        return trainer

    def correct(self, task: Task, trainer: Trainer, views: dict[int, View], together: bool) -> None:
        """Corrects expressions, and the poses of all frames together, or each by itself, whose next steps go on by its Hessian."""
        with self.open_equations(task, trainer.gaussians(), views) as equations:
            if together:
                correct_midway(task.poses, task.trained, trainer.gaussians, equations)
            else:
                inverses = correct_each(task.poses, task.trained, trainer.gaussians, equations)
                task.poses.newton = newton_steps(inverses, views)
        correct_expressions(task.poses, trainer.gaussians(), views)

    @contextmanager
    def open_rounds(self, task: Task, views: dict[int, View], gaussians: Gaussians, plan: list[Round]) -> Iterator[Rounds]:
        """As `Backend.open_rounds`."""
        yield CpuRounds(task, views, gaussians, plan)

    @contextmanager
    def open_equations(self, task: Task, gaussians: Gaussians, views: dict[int, View]) -> Iterator[Equations]:
        """As `Backend.open_equations`."""
        yield FrameEquations(task.poses, gaussians.face, views)

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
        steps = [Step(t, self._views[t], done, background, number)
                 for number, (t, background) in enumerate(zip(map(int, frames), backgrounds, strict=True))]
        for begin in range(0, len(steps), AT_ONCE):
            self._trainer.learn(steps[begin:begin + AT_ONCE])

    def gaussians(self) -> Gaussians:
        return self._trainer.gaussians()
