"""Recipe `fast` on the GPU: the CPU's start, the steps inside `CudaTrainer`, and a CPU trainer that takes the result over.

Draws, rates and order of the steps are those of `fast.train`; what is not steps is the same code.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from gsac.avatar.cuda.align import Aligner, AlignRecipe
from gsac.avatar.cuda.arrays import BodyArrays, Shot
from gsac.avatar.cuda.device import DeviceError
from gsac.avatar.cuda.kernels import CompileError
from gsac.avatar.cuda.recipe import Recipe
from gsac.avatar.cuda.rounds import Round, RoundsRecipe, RoundsTrainer
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.lpips import Lpips
from gsac.stages.contract import StageError
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.fast import prealign, size_search
from gsac.stages.train.fast import trainer as fast
from gsac.stages.train.finite import finite, values
from gsac.stages.train.gaussians import cloth_offsets
from gsac.stages.train.judge.heldout import TEST_END, TEST_MASK, TEST_RATE
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.poses import bundle_adjust
from gsac.stages.train.poses.poses import EXPRESSION, HAND_SHARE, JOINT, SHIFT, TURN, Poses
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, person_crop

STEPS = 3200
"""More than twice the CPU's: 0.4 s more for 0.15 dB, 0.3 with poses moved to their images."""


POSES_STAY = {"pose_rate": 0.0, "expression_rate": 0.0, "joint_rate": 0.0}
PERCEPTUAL_STEPS = 200
"""The last, of a training or a refit, that have LPIPS of a window where it is in the loss: 2.3 ms more each."""


def train(task: Task, count: int) -> tuple[fast.Trainer, dict[int, View], dict[int, View]]:
    """As `fast.train`. Raises StageError where the GPU fails, or naming the step and the quantity that is not finite."""
    fine, coarse = fast.crops(task)
    gaussians = fast.start(task, coarse, count)
    recipe = recipe_of(task.config, count, **of_windows(task))
    with training(task.poses, task.trained, [coarse, fine], gaussians, recipe, network=task.lpips) as trainer:
        if task.config.pose_rounds:
            correct_midway(trainer, task, fine)
        follow(trainer, task, math.ceil(recipe.offset_share * recipe.steps))
        body = trainer.body
        folded = cloth_offsets.fold(trainer.gaussians(), body.rest[0], trainer.offset(), body.faces)
        task.poses.offset = np.zeros_like(task.poses.offset)
        middle = fast.Trainer(folded, task, settled=True)
        middle.lay_unseen(coarse)
        trainer.replace(middle.gaussians(), ~middle.seen, middle.reach)
        follow(trainer, task, recipe.steps)
        hand_back(trainer, task)
        kept = settled(trainer, task)
        kept.seen = middle.seen
        return kept, fine, coarse


def correct_midway(trainer: CudaTrainer, task: Task, views: dict[int, View]) -> None:
    """Trains up to where `fast.train` corrects all poses together, and does so; the poses' equations are solved on the CPU."""
    if midway := round(fast.MIDWAY * trainer.recipe.steps):
        follow(trainer, task, midway)
        poses, trained = task.poses, task.trained
        if bundle_adjust.correct_midway(poses, trained, trainer.gaussians, trainer.face, views):
            trainer.place(poses.pose[trained], poses.transl[trained])


def refit(task: Task, fewer: fast.Trainer, views: dict[int, View]) -> fast.Trainer:
    """As `size_search.refit`."""
    gaussians = fewer.gaussians()
    recipe = recipe_of(size_search.refit_config(task.config), len(gaussians), steps=size_search.refit_steps(task),
                       begin=size_search.REFIT_FROM, coarse_share=0.0, offset_rate=0.0, **POSES_STAY, **of_windows(task))
    first = int(task.trained[0])
    whole = views[first].camera.focal == task.views[first].camera.focal  # the smaller images of coarser levels have no windows
    with training(task.poses, task.trained, [views], gaussians, recipe, network=task.lpips if whole else None) as trainer:
        trainer.replace(gaussians, ~fewer.seen, fewer.reach)
        trainer.train(recipe.steps)
        kept = settled(trainer, task)
        kept.seen = fewer.seen
        return kept


def align_poses(gaussians: Gaussians, poses: Poses, frames: np.ndarray, views: list[View], steps: int) -> None:
    """As `evaluate.align_poses`."""
    if not len(frames):
        return
    recipe = AlignRecipe(steps=steps * len(frames), pose_rate=TEST_RATE, pose_end=TEST_END, mask=TEST_MASK, hand_share=HAND_SHARE)
    with training(poses, frames, [{int(t): person_crop(views[t]) for t in frames}], gaussians, recipe, Aligner) as trainer:
        trainer.train(recipe.steps)
        poses.pose[frames], poses.transl[frames] = trainer.poses()


@contextmanager
def learning(task: Task, views: dict[int, View], gaussians: Gaussians, plan: list[prealign.Round]):
    """As `prealign.learning_on_cpu`."""
    poses, where = task.poses, {int(t): k for k, t in enumerate(task.trained)}
    rounds = [Round(np.array([where[int(t)] for t in one.frames]), one.backgrounds, one.done) for one in plan]
    recipe = recipe_of(task.config, len(gaussians), RoundsRecipe, rounds=rounds, steps=sum(len(one.frames) for one in rounds),
                       **POSES_STAY)
    with training(poses, task.trained, [views], gaussians, recipe, RoundsTrainer) as trainer:
        def learn(one: prealign.Round) -> None:
            trainer.place(poses.pose[task.trained], poses.transl[task.trained])
            trainer.train(len(one.frames))
            poses.offset = trainer.offset()

        yield learn, trainer.gaussians, gaussians.face
        task.gpu_seconds += trainer.seconds


def recipe_of(config: TrainConfig, count: int, kind: type[Recipe] = Recipe, **more) -> Recipe:
    """Recipe `fast` for so many gaussians, `more` on top."""
    steps = config.steps or STEPS
    given = {"steps": steps, "largest": fast.largest(config, count), "coarse_share": fast.coarse_steps(steps) / steps,
             "offset_rate": fast.OFFSET_RATE, "offset_share": fast.OFFSET_SHARE, "offset_every": cloth_offsets.EVERY,
             "smoothness": cloth_offsets.SMOOTHNESS, "gain_rate": fast.GAIN_RATE if config.exposure else 0.0, "turn_unit": TURN,
             "shift_unit": SHIFT, "expression_unit": EXPRESSION, "joint_unit": JOINT, "hand_share": HAND_SHARE}
    return kind.of(config, **(given | more))


def of_windows(task: Task) -> dict:
    """What a recipe says of LPIPS of windows, for `recipe_of`."""
    camera = task.views[0].camera
    return {"perceptual": paper.LPIPS, "perceptual_steps": PERCEPTUAL_STEPS, "frame_size": (camera.width, camera.height)}


def settled(trainer: CudaTrainer, task: Task) -> fast.Trainer:
    """A CPU trainer with the gaussians and gains as they stand on the GPU."""
    gaussians = trainer.gaussians()
    finite(f"after step {trainer.recipe.steps}", values(gaussians))
    kept = fast.Trainer(gaussians, task, settled=True)
    if trainer.recipe.gain_rate:
        kept.gains = dict(zip(task.trained.tolist(), trainer.gains().astype(np.float64), strict=True))
    return kept


@contextmanager
def training(poses: Poses, frames: np.ndarray, levels: list[dict[int, View]], gaussians: Gaussians, recipe: Recipe,
             kind: type[CudaTrainer] = CudaTrainer, network: Lpips | None = None) -> Iterator[CudaTrainer]:
    """A trainer over the frames (indices), closed at the end. levels: frame -> view, coarse first; network: for the loss."""
    trainer = None
    try:
        shots = [[Shot(view.pixels, view.camera, view.corner) for view in (views[int(t)] for t in frames)] for views in levels]
        trainer = kind(body_arrays(poses, frames, recipe), shots, poses.pose[frames], poses.transl[frames], gaussians,
                       recipe, network=network)
        yield trainer
    except (DeviceError, CompileError) as error:
        raise StageError(f"train on the GPU: {error}; or set train.device to cpu") from error
    finally:
        if trainer is not None:
            trainer.close()


def body_arrays(poses: Poses, frames: np.ndarray, recipe: Recipe) -> BodyArrays:
    """The body as the frames wear it, the first frame's rest first, with what the recipe learns of it."""
    body, rests, rest_of, known = poses.body, [], [], {}
    for t in frames:
        vertices, joints = poses.rest(int(t))
        vertices = vertices + poses.offset
        at = known.setdefault(vertices.tobytes(), len(rests))
        if at == len(rests):
            rests.append(vertices)
        rest_of.append(at)
    arrays = BodyArrays(np.stack(rests), np.array(rest_of), joints, np.asarray(body.parents), body.skin_index, body.skin_weight,
                        np.asarray(body.faces), expression=body.exprdirs if recipe.expression_rate else None)
    if not recipe.beta_rate:
        return arrays
    shape = body.shapedirs[:, :, :len(poses.betas)]
    return arrays._replace(shape=shape, joint_shape=np.tensordot(body.J_regressor, shape, 1))


def follow(trainer: CudaTrainer, task: Task, until: int) -> None:
    """Trains up to a step, and says at every mark on the way how far it is."""
    steps, done = trainer.recipe.steps, trainer.state().step
    if done == until:
        return  # of very few steps none may be left
    for stop in [*(mark for mark in task.marks(steps) if done < mark < until), until]:
        trainer.train(stop - done)
        losses = trainer.losses()[done:].mean(1)
        finite(f"at step {done + int(np.argmin(np.isfinite(losses)))}", {"loss": losses})
        hand_back(trainer, task)
        for step, loss in enumerate(losses, done + 1):
            task.checkpoint(step, steps, float(loss), trainer.gaussians, task.gpu_seconds + trainer.seconds)
        task.progress(stop, steps, "steps")
        done = stop


def hand_back(trainer: CudaTrainer, task: Task) -> None:
    """Poses, and what else of the body is learned, as they stand on the GPU."""
    poses = task.poses
    poses.pose[task.trained], poses.transl[task.trained] = trainer.poses()
    poses.offset = trainer.offset()
    if trainer.recipe.beta_rate:
        poses.betas = np.array(poses.params.betas, np.float64) + trainer.betas()
        poses.forget_rests()
    if trainer.recipe.expression_rate:
        poses.expression[task.trained] = trainer.expressions()
        poses.forget_expressions()
    if trainer.recipe.joint_rate:
        poses.joint_offset = trainer.joint_offset()
