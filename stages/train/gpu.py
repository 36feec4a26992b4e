"""What recipes `fast` and `paper` share of driving the GPU: opening a trainer, following its steps, taking back what it learned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import numpy as np

from gsac.avatar.cuda.arrays import BodyArrays, Shot, SideShot
from gsac.avatar.cuda.device import DeviceError
from gsac.avatar.cuda.kernels import CompileError
from gsac.avatar.cuda.paper import PaperGaussians, PaperRecipe
from gsac.avatar.cuda.recipe import Recipe
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import JAW
from gsac.stages.contract import StageError
from gsac.stages.train.finite import require_finite
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.unseen_sides import Side
from gsac.stages.train.task import Task
from gsac.stages.train.views import View

LPIPS_STEPS = 200
"""Steps of recipe `fast`, the last of a training or a refit, that have LPIPS of a window where it is in the loss: 2.3 ms each."""

Kind = TypeVar("Kind", bound=CudaTrainer)


@contextmanager
def open_trainer(kind: type[Kind], poses: Poses, frames: np.ndarray, levels: list[dict[int, View]],
                 gaussians: Gaussians | PaperGaussians, recipe: Recipe, network: FeatureDistance | None = None,
                 sides: Sequence[Side] = ()) -> Iterator[Kind]:
    """A trainer over frames, (n,) indices, that is closed at the end. Raises StageError where the GPU fails.

    levels: frame -> view, coarse first; network: for the loss; sides: those of the recipe, of bodies of `frames`.
    """
    trainer = None
    try:
        shots = [[make_shot(views[int(t)]) for t in frames] for views in levels]
        turned = [SideShot(int(np.flatnonzero(frames == t)[0]), turn, make_shot(view)) for t, turn, view in sides]
        trainer = kind(body_arrays(poses, frames, recipe), shots, poses.pose[frames], poses.transl[frames], gaussians,
                       recipe, network=network, sides=turned)
        yield trainer
    except (DeviceError, CompileError) as error:
        raise StageError(f"train on the GPU: {error}; or set train.device to cpu") from error
    finally:
        if trainer is not None:
            trainer.close()


def make_shot(view: View) -> Shot:
    """The view, as the GPU's trainer takes it."""
    return Shot(view.pixels, view.camera, view.corner)


def body_arrays(poses: Poses, frames: np.ndarray, recipe: Recipe) -> BodyArrays:
    """The body for frames, (n,) indices, with what the recipe learns of it."""
    body = poses.body
    joints = poses.rest(int(frames[0]))[1]
    expression = body.exprdirs if recipe.expression_rate else None
    if isinstance(recipe, PaperRecipe):  # a jaw without skin opens the mouth by expressions: its turn is three more of them
        expression = np.concatenate([body.exprdirs, body.exprdirs @ body.jaw_actions], 2)
    arrays = BodyArrays(rest_shapes(poses, frames, poses.offset), np.arange(len(frames)), joints, np.asarray(body.parents),
                        body.skin_index, body.skin_weight, np.asarray(body.faces), expression=expression)
    if not recipe.beta_rate:
        return arrays
    shape = body.shapedirs[:, :, :len(poses.betas)]
    return arrays._replace(shape=shape, joint_shape=np.tensordot(body.J_regressor, shape, 1))


def rest_shapes(poses: Poses, frames: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """(n, V, 3) m, vertices at rest of frames, (n,) indices, in their expressions. offset: (V, 3) m, of the surface.

    Pose correctives are part of them, those of each frame's pose as it stands.
    """
    return np.stack([poses.body.correct(poses.rest(int(t))[0] + offset, poses.pose[t]) for t in frames])


def train_until(trainer: CudaTrainer, task: Task, until: int) -> None:
    """Trains up to a step, and stops at every mark on the way to report the losses and hand back the poses."""
    steps, done = trainer.recipe.steps, trainer.state().step
    if done == until:
        return  # of very few steps none may be left
    for stop in [*(mark for mark in task.marks(steps) if done < mark < until), until]:
        trainer.train(stop - done)
        losses = trainer.losses()[done:].mean(1)
        require_finite(f"at step {done + int(np.argmin(np.isfinite(losses)))}", {"loss": losses})
        hand_back(trainer, task)
        for step, loss in enumerate(losses, done + 1):
            task.checkpoint(step, steps, float(loss), trainer.gaussians, task.gpu_seconds + trainer.seconds)
        task.progress(stop, steps, "steps")
        done = stop


def hand_back(trainer: CudaTrainer, task: Task) -> None:
    """Copies poses, and what else of the body is learned, from the GPU into task.poses."""
    poses = task.poses
    poses.pose[task.trained], poses.transl[task.trained] = trainer.poses()
    poses.offset = trainer.offset()
    if trainer.recipe.beta_rate:
        poses.betas = np.array(poses.params.betas, np.float64) + trainer.betas()
        poses.forget_rests()
    if trainer.recipe.expression_rate:
        learned, size = trainer.expressions(), poses.expression.shape[1]
        poses.expression[task.trained] = learned[:, :size]
        if learned.shape[1] > size:
            poses.pose[task.trained, JAW] += learned[:, size:]
        poses.forget_expressions()
    if trainer.recipe.joint_rate:
        poses.joint_offset = trainer.joint_offset()
