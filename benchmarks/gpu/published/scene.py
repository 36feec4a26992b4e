"""What a training by the published definition starts from: the frames, body, batches and colours that recipe `paper` has of a run.

A scene is written on the machine of the run and read with numpy alone where it is trained on.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gsac.avatar.body import BodyParams
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.task import Task
    from gsac.stages.train.views import View


@dataclass
class Scene:
    """T trained frames in square frames of `side` px, of which a box common to all is kept; a step sees B of them."""

    side: np.ndarray
    """A scalar, px."""
    pixels: np.ndarray
    """(T, h, w, 4) uint8, premultiplied RGB and mask."""
    corner: np.ndarray
    """(2,) px, of the box in the square."""
    focal: np.ndarray
    """(2,) px."""
    centre: np.ndarray
    """(T, 2) px, in the box."""
    order: np.ndarray
    """(S, B) int32, frames of each step."""
    background: np.ndarray
    """(S, B, 3) in 0..1."""
    rgb: np.ndarray
    """(F, 3), the first colours."""
    faces: np.ndarray
    """(F, 3)."""
    template: np.ndarray
    """(V, 3) m."""
    shapedirs: np.ndarray
    """(V, 3, K) m."""
    exprdirs: np.ndarray
    """(V, 3, E) m."""
    joints: np.ndarray
    """(J, 3) m, of the template, with the clip's offsets."""
    joint_dirs: np.ndarray
    """(J, 3, K) m."""
    weights: np.ndarray
    """(V, J)."""
    jaw_actions: np.ndarray
    """(E, 3), expression that a jaw rotation stands for."""
    parents: np.ndarray
    """(J,)."""
    betas: np.ndarray
    """(K,)."""
    pose: np.ndarray
    """(T, J, 3) axis-angle."""
    transl: np.ndarray
    """(T, 3) m."""
    expression: np.ndarray
    """(T, E)."""

    @classmethod
    def read(cls, path: Path) -> Scene:
        """From a file of `write`."""
        with np.load(path) as arrays:
            return cls(**{field.name: arrays[field.name] for field in fields(cls)})

    def write(self, path: Path) -> None:
        """Compressed."""
        np.savez_compressed(path, **{field.name: getattr(self, field.name) for field in fields(self)})


def task_of_run(run: Path, height: int) -> Task:
    """The Task that stage `train` hands to recipe `paper`, without the frames held out.

    run: folder of a finished `gsac run`; height: px that frames are scaled to.
    """
    from gsac.avatar.artifacts import Clip
    from gsac.avatar.body import BodyParams
    from gsac.benchmarks.training import read_run
    from gsac.stages.train.choose_heldout import hold_out
    from gsac.stages.train.views import read_views

    inputs, config = read_run(run).inputs, paper_config()
    clip, params = Clip.read(inputs["split/clip.json"]), BodyParams.read(inputs["smplx/body.npz"])
    views, empty = read_views(inputs["split/frames"], inputs["segment/alpha"], params.camera(clip.width, clip.height), height,
                              mixed=True, occluder=params.occluder)
    usable = ~params.lost
    usable[empty] = False
    trained = np.setdiff1d(np.flatnonzero(usable), hold_out(params.global_orient, usable, config.holdout))
    return make_task(views, trained, params, config)


def task_of(scene: Scene, seed: int = 0) -> Task:
    """A Task that recipe `paper` trains on as on the run that the scene is of."""
    from gsac.avatar.body import Body, BodyParams
    from gsac.avatar.camera import Camera
    from gsac.stages.train.views import View

    (height, width), side, corner = scene.pixels.shape[1:3], int(scene.side), scene.corner.tolist()
    offset = scene.joints - Body.load().J_regressor @ scene.template
    params = BodyParams.from_pose(scene.pose, scene.transl, scene.betas, scene.expression, scene.focal, (0, 0), offset)
    views = []
    for pixels, (x, y) in zip(scene.pixels, scene.centre.tolist(), strict=True):
        focal = tuple(scene.focal.tolist())
        views.append(View(Camera(focal, (x, y), width, height), pixels, tuple(corner),
                          Camera(focal, (x + corner[0], y + corner[1]), side, side)))
    return make_task(views, np.arange(len(views)), params, paper_config(seed))


def paper_config(seed: int = 0) -> TrainConfig:
    """Recipe `paper` by its defaults."""
    from gsac.stages.contract import make_config
    from gsac.stages.train import STAGE

    return make_config(STAGE, {"recipe": "paper", "seed": seed})


def make_task(views: list[View], trained: np.ndarray, params: BodyParams, config: TrainConfig) -> Task:
    """A Task of the open body. trained: (n,) indices of views."""
    from gsac.avatar.body import Body
    from gsac.stages.train.poses.poses import Poses
    from gsac.stages.train.task import Task

    params.rest_expression = None  # as published
    return Task(views, trained, np.arange(0), Poses(Body.load(), params), config, lambda *args: None)


def scene_of(task: Task) -> Scene:
    """What recipe `paper` starts from on a Task."""
    from gsac.stages.train.paper.square import side_of
    from gsac.stages.train.paper.trainer import crop_views, plan_batches

    body, params, side = task.poses.body, task.poses.params, side_of(task.views)
    assert body.posedirs is None, "the open body has no pose correctives"
    crops = crop_views(task)
    views = [crops[int(t)] for t in task.trained]
    corners = np.array([view.corner for view in views])
    sizes = np.array([view.pixels.shape[1::-1] for view in views])
    first = corners.min(0)
    width, height = (corners + sizes).max(0) - first
    pixels = np.zeros((len(views), height, width, 4), np.uint8)
    for out, view, (x, y), (w, h) in zip(pixels, views, corners - first, sizes, strict=True):
        out[y:y + h, x:x + w] = view.pixels
    batches, trained = plan_batches(task), task.trained
    regressor, count = body.J_regressor, len(params.betas)
    dirs = body.shapedirs[..., :count]
    arrays = dict(
        focal=views[0].camera.focal, centre=[np.add(v.camera.center, v.corner) - first for v in views],
        background=batches.background, rgb=np.random.default_rng(task.config.seed).random((len(body.faces), 3)),
        template=body.v_template, shapedirs=dirs, exprdirs=body.exprdirs, joints=regressor @ body.v_template + params.joint_offset,
        joint_dirs=np.einsum("jv,vck->jck", regressor, dirs), weights=body.weights / body.weights.sum(1, keepdims=True),
        jaw_actions=body.jaw_actions,
        betas=params.betas, pose=params.pose[trained], transl=params.transl[trained], expression=params.expression[trained])
    return Scene(side=np.array(side), corner=first, pixels=pixels, order=batches.order, faces=body.faces.astype(np.int64),
                 parents=np.array(body.parents), **{name: np.asarray(value, np.float32) for name, value in arrays.items()})
