"""Recipe `fast` on the GPU: the CPU's start, the steps inside `CudaTrainer`, and a CPU trainer that takes the result over.

Draws, rates and order of the steps are those of `cpu.Cpu`; what is not steps is the same code.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.cuda import rounds as cuda_rounds
from gsac.avatar.cuda.align import Aligner, AlignRecipe
from gsac.avatar.cuda.equations import EquationsRecipe, PoseEquations
from gsac.avatar.cuda.recipe import Recipe
from gsac.avatar.cuda.rounds import RoundsRecipe, RoundsTrainer
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.stages.train.config import FAST_STEPS, TrainConfig, coarse_share, coarse_steps
from gsac.stages.train.fast import schedule
from gsac.stages.train.fast.backend import Backend, Round, Rounds, Trained
from gsac.stages.train.fast.initial_gaussians import crop_views, init_gaussians
from gsac.stages.train.fast.refit import Pace, refit_config, refit_steps
from gsac.stages.train.fast.trainer import Trainer, learned_values
from gsac.stages.train.finite import named_values, require_finite
from gsac.stages.train.gaussians import cloth_offsets
from gsac.stages.train.gaussians.joint_limits import TIE, limit_where_grown
from gsac.stages.train.gaussians.mean_of_steps import MeanOfSteps
from gsac.stages.train.gpu import LPIPS_STEPS, hand_back, open_trainer, rest_shapes, train_until
from gsac.stages.train.judge.heldout import TEST_END, TEST_MASK, TEST_RATE
from gsac.stages.train.poses import bundle_adjust, own_errors
from gsac.stages.train.poses.bundle_adjust import Equations
from gsac.stages.train.poses.expressions import correct_expressions
from gsac.stages.train.poses.photometric import CURVATURE, NormalEquations, joint_shares
from gsac.stages.train.poses.poses import HAND_SHARE, JOINT, SHIFT, TURN, Poses
from gsac.stages.train.poses.unseen_sides import SHARP, side_at
from gsac.stages.train.task import LPIPS_WEIGHT, Task
from gsac.stages.train.views import View, Views, of_each, person_crop

MOMENTS = 10
"""Steps at most, spread evenly over the last ones, whose gaussians are read to be averaged."""
POSES_STAY = {"pose_rate": 0.0, "joint_rate": 0.0}

Sizes = list[dict[int, View]]
"""Trained frame -> its view, of half the size and of the whole."""
SomeRecipe = TypeVar("SomeRecipe", bound=Recipe)


class Cuda(Backend):
    """The steps of a training as one graph of kernels; equations of the poses are worked out there, and solved on the CPU."""

    device = "cuda"

    def train(self, task: Task, count: int) -> Trained:
        """As `Backend.train`; keeps no checkpoints."""
        fine = crop_views(task)
        coarse = of_each(View.halved, fine)
        gaussians = init_gaussians(task, coarse, count)
        steps = task.config.steps or FAST_STEPS["cuda"]
        recipe = make_recipe(task.config, count, coarse_share=coarse_steps(schedule.person_pixels(task), steps) / steps,
                             least=schedule.shortest_axis(task), **limits_at_joints(task, count), **lpips_options(task),
                             **looks_at_sides(task, steps))
        with (open_trainer(CudaTrainer, task.poses, task.trained, [coarse, fine], gaussians, recipe, task.network,
                           task.sides) as trainer,
              self.open_equations(task, gaussians, coarse) as equations):
            self.train_correcting(trainer, task, [coarse, fine], equations, math.ceil(recipe.offset_share * recipe.steps))
            body = trainer.body
            folded = cloth_offsets.fold(trainer.gaussians(), body.rest[0], trainer.offset(), body.faces)
            task.poses.offset = np.zeros_like(task.poses.offset)
            middle = Trainer(folded, task, frozen_body=True)
            middle.lay_unseen(coarse)
            trainer.replace(middle.gaussians(), ~middle.seen, middle.reach)
            mean = self.train_averaging(trainer, task, [coarse, fine], equations)
            hand_back(trainer, task)
            kept = take_over(trainer, task)
            kept.values, kept.seen = mean.values(), middle.seen
            return Trained(kept, fine, coarse)

    def refit(self, task: Task, trainer: Trainer, views: dict[int, View], pace: Pace,
              coarse: dict[int, View] | None = None) -> Trainer:
        """As `Backend.refit`, without the mean of the last steps."""
        gaussians = trainer.gaussians()
        share = pace.begin + (1 - pace.begin) * coarse_share(schedule.person_pixels(task)) if coarse else 0.0
        steps, looks = refit_steps(task.config, pace), {}
        if coarse:
            looks = looks_at_sides(task, steps, pace.begin)
        recipe = make_recipe(refit_config(task.config, pace), len(gaussians), steps=steps, begin=pace.begin, coarse_share=share,
                             offset_rate=0.0, least=trainer.least, **POSES_STAY, **lpips_options(task), **looks)
        first = int(task.trained[0])
        whole = views[first].camera.focal == task.views[first].camera.focal  # smaller images of coarser levels have no windows
        network = task.network if whole else None
        with open_trainer(CudaTrainer, task.poses, task.trained, [coarse, views] if coarse else [views], gaussians, recipe,
                          network, task.sides if coarse else ()) as on_gpu:
            on_gpu.replace(gaussians, ~trainer.seen, trainer.reach)
            on_gpu.train(recipe.steps)
            kept = take_over(on_gpu, task)
            kept.seen = trainer.seen
            return kept

    @contextmanager
    def open_rounds(self, task: Task, views: dict[int, View], gaussians: Gaussians, plan: list[Round]) -> Iterator[Rounds]:
        """As `Backend.open_rounds`; their time on the GPU is added to task.gpu_seconds."""
        where = {int(t): k for k, t in enumerate(task.trained)}
        rounds = [cuda_rounds.Round(np.array([where[int(t)] for t in one.frames]), one.backgrounds, one.done) for one in plan]
        recipe = make_recipe(task.config, len(gaussians), RoundsRecipe, rounds=rounds, steps=sum(len(one.frames) for one in rounds),
                             least=schedule.shortest_axis(task), **limits_at_joints(task, len(gaussians)), **POSES_STAY)
        with open_trainer(RoundsTrainer, task.poses, task.trained, [views], gaussians, recipe) as trainer:
            yield CudaRounds(trainer, task, gaussians)
            task.gpu_seconds += trainer.seconds

    @contextmanager
    def open_equations(self, task: Task, gaussians: Gaussians, views: dict[int, View]) -> Iterator[Equations]:
        """As `Backend.open_equations`; their time on the GPU is added to task.gpu_seconds."""
        frames = np.array(list(views))
        recipe = EquationsRecipe(steps=len(frames), turn_share=joint_shares(task.poses.body, gaussians.face))
        with open_trainer(PoseEquations, task.poses, frames, [views], gaussians, recipe) as trainer:
            yield CudaEquations(trainer, task.poses, frames)
            task.gpu_seconds += trainer.seconds

    def train_correcting(self, trainer: CudaTrainer, task: Task, sizes: Sizes, equations: Equations, until: int) -> None:
        """Trains up to a step, and corrects poses and expressions on the way where `Cpu.train` does.

        sizes: the trainer's; equations: of views of half the size.
        """
        poses, trained = task.poses, task.trained
        steps = trainer.recipe.steps
        for number, step in enumerate(schedule.correction_steps(task.config, steps, self.device)):
            if trainer.state().step < step <= until:
                train_until(trainer, task, step)
                correct = own_errors.correct_each if number else bundle_adjust.correct_midway
                correct(poses, trained, trainer.gaussians, equations)
                correct_expressions(poses, trainer.gaussians(), sizes[step >= trainer.recipe.coarse_share * steps])
                trainer.place(poses.pose[trained], poses.transl[trained])
                trainer.wear(rest_shapes(poses, trained, np.zeros_like(poses.offset)))
        train_until(trainer, task, until)

    def train_averaging(self, trainer: CudaTrainer, task: Task, sizes: Sizes, equations: Equations) -> MeanOfSteps:
        """`train_correcting` to the end. Returns the mean over the last steps; with a network in the loss, over those it is in."""
        steps, mean = trainer.recipe.steps, MeanOfSteps()
        begin = schedule.averaged_from(steps, self.device)
        if task.network:
            begin = max(begin, steps - LPIPS_STEPS)
        for step in np.unique(np.linspace(begin + 1, steps, MOMENTS).round().astype(int)):
            self.train_correcting(trainer, task, sizes, equations, int(step))
            mean.add(learned_values(trainer.gaussians()))
        return mean

    def align_poses(self, gaussians: Gaussians, poses: Poses, frames: np.ndarray, views: Views, steps: int) -> None:
        """As `Backend.align_poses`. frames: (n,)."""
        if not len(frames):
            return
        recipe = AlignRecipe(steps=steps * len(frames), pose_rate=TEST_RATE, pose_end=TEST_END, mask=TEST_MASK,
                             hand_share=HAND_SHARE)
        with open_trainer(Aligner, poses, frames, [{int(t): person_crop(views[t]) for t in frames}], gaussians, recipe) as trainer:
            trainer.train(recipe.steps)
            poses.pose[frames], poses.transl[frames] = trainer.poses()


class CudaRounds(Rounds):
    """A RoundsTrainer that takes the task's poses before every round."""

    def __init__(self, trainer: RoundsTrainer, task: Task, gaussians: Gaussians):
        self._trainer, self._task, self.face = trainer, task, gaussians.face

    def learn(self, number: int) -> None:
        poses, trained = self._task.poses, self._task.trained
        self._trainer.place(poses.pose[trained], poses.transl[trained])
        self._trainer.train(len(self._trainer.recipe.rounds[number].frames))
        poses.offset = self._trainer.offset()

    def gaussians(self) -> Gaussians:
        return self._trainer.gaussians()


class CudaEquations:
    """`bundle_adjust.Equations` of the frames that a PoseEquations holds, (n,) indices."""

    def __init__(self, trainer: PoseEquations, poses: Poses, frames: np.ndarray):
        self._trainer, self._poses, self._frames, self._worn = trainer, poses, frames, poses.offset.copy()

    def __call__(self, gaussians: Gaussians) -> list[tuple[int, NormalEquations]]:
        poses, frames = self._poses, self._frames
        self._trainer.wear(rest_shapes(poses, frames, self._worn))
        found = self._trainer.measure(gaussians, poses.pose[frames], poses.transl[frames], poses.offset - self._worn,
                                      poses.rest(int(frames[0]))[1])
        turns = rotation.by_turns(poses.pose[frames][:, BODY], found.gradient[:, BODY])
        gradients = np.concatenate([turns.reshape(len(frames), -1), found.gradient[:, -1]], 1)
        hessians = CURVATURE * found.hessian.astype(np.float64)
        return [(int(t), NormalEquations(gradient, hessian, float(error), int(pixels))) for t, gradient, hessian, error, pixels
                in zip(frames, gradients, hessians, found.error, found.pixels, strict=True)]


def make_recipe(config: TrainConfig, count: int, kind: type[SomeRecipe] = Recipe, **more: Any) -> SomeRecipe:
    """Recipe `fast` for `count` gaussians. more: fields of the recipe, which take precedence."""
    steps = config.steps or FAST_STEPS["cuda"]
    given = {"steps": steps, "largest": schedule.longest_axis(config, count),
             "end": schedule.END, "mu_end": schedule.MU_END, "offset_rate": schedule.OFFSET_RATE,
             "offset_share": schedule.OFFSET_SHARE, "offset_every": cloth_offsets.EVERY, "smoothness": cloth_offsets.SMOOTHNESS,
             "gain_rate": schedule.GAIN_RATE if config.exposure else 0.0, "turn_unit": TURN, "shift_unit": SHIFT,
             "joint_unit": JOINT, "hand_share": HAND_SHARE}
    return kind.of(config, **(given | more))


def limits_at_joints(task: Task, count: int) -> dict[str, Any]:
    """Fields of a recipe for the limits of `count` gaussians where joints bend, for `make_recipe`."""
    longest, tied = limit_where_grown(task.growth, schedule.longest_axis(task.config, count))
    return {"largest": longest, "tied": tied, "tie": TIE}


def looks_at_sides(task: Task, steps: int, begin: float = 0.0) -> dict[str, Any]:
    """Fields of a recipe for the task's sides, for `make_recipe`. begin: share of a training that the first step has behind it."""
    found = [side_at(number, begin + (1 - begin) * number / steps, len(task.sides)) for number in range(steps)]
    return {"sides": np.array([-1 if side is None else side for side in found]), "sharp": SHARP}


def lpips_options(task: Task) -> dict[str, Any]:
    """Fields of a recipe for LPIPS of windows, for `make_recipe`."""
    camera = task.views[0].frame
    return {"perceptual": LPIPS_WEIGHT, "perceptual_steps": LPIPS_STEPS, "frame_size": (camera.width, camera.height)}


def take_over(trainer: CudaTrainer, task: Task) -> Trainer:
    """A CPU trainer with the gaussians and gains as they stand on the GPU."""
    gaussians = trainer.gaussians()
    require_finite(f"after step {trainer.recipe.steps}", named_values(gaussians))
    kept = Trainer(gaussians, task, frozen_body=True)
    if trainer.recipe.gain_rate:
        kept.gains = dict(zip(task.trained.tolist(), trainer.gains().astype(np.float64), strict=True))
    return kept
