"""Recipe `fast`: area-weighted placement, coarse to fine, one frame a step, poses refined on the way.

Half the size first, rates that decay, one gaussian budget from the start (no densification); all poses solved together before
the steps (`bundle`) and in their midst (`corrections`). Gaussians are limited after every step instead of being punished in the
loss: no needle, no giant and no floater can arise, whatever the weights.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from gsac.avatar import losses
from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import logit, sigmoid
from gsac.avatar.raster import render_bound, render_bound_backward
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.checkpoint import standing
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.finite import finite, gradients, pose
from gsac.stages.train.gaussians.cloth_offsets import Offsets, fold
from gsac.stages.train.gaussians.first_colours import PosedFrame, fill_unseen, find_light, mean_colours, read_sights
from gsac.stages.train.gaussians.kernels import adam_rows, count_rows, limit, on_background, through_background
from gsac.stages.train.gaussians.unseen import enough, laid, levelled, shown
from gsac.stages.train.poses.bundle_adjust import correct_midway
from gsac.stages.train.task import Fit, Loop, Task
from gsac.stages.train.views import View, person_crop

STEPS = 1400
COARSE_SHARE = 0.15
"""Part of the steps that run at half the size; no more of them in a longer training."""
MIDWAY = 0.3
"""Part of the steps after which the poses of all frames are corrected once more, together."""
OFFSET_SHARE = 0.6
"""Part of the steps that also move the body's surface out to clothes and hair."""
OFFSET_RATE = 1e-3
"""m for each step of the offsets, falls to a tenth."""
COLOUR_FRAMES = 24
"""How many frames the first colours are read from."""
LARGEST_OF = 12000
"""Gaussians of an avatar whose longest axis may be `train.largest`; fewer must each cover more."""
GAIN_RATE = 2e-3
SETTLED_REACH = 0.25
"""Share of `train.reach` that a gaussian may move once the surface stands: clothes and hair are in it by then."""
KEPT = ("face", "values", "first", "second", "count", "start", "light", "seen")
"""Attributes of Trainer that go into a checkpoint as they are."""


def fit(task: Task, loop: Loop, count: int | None = None) -> Fit:
    """count: how many gaussians, else as configured. Raises StageError naming the step and the quantity that is not finite."""
    trainer, _, coarse = loop.train(task, count or task.config.gaussians)
    return Fit(*trainer.recoloured(coarse), dict(trainer.gains))


def train(task: Task, count: int) -> tuple[Trainer, dict[int, View], dict[int, View]]:
    """The trained gaussians, and the trained frames at full and at half the size."""
    config = task.config
    rng = np.random.default_rng(config.seed)
    fine, coarse = crops(task)
    steps = config.steps or STEPS
    coarse_until = coarse_steps(steps)
    order: list[int] = []
    if task.resumed is None:
        trainer, first = Trainer(start(task, coarse, count), task), 0
    else:
        trainer, first = Trainer.restored(task.resumed["trainer"], task), task.resumed["step"]
        order, rng.bit_generator.state = task.resumed["order"], task.resumed["rng"]
        task.resumed = None
    midway = round(MIDWAY * steps) if config.pose_rounds else -1
    for step in range(first, steps):
        if step == midway:
            correct_midway(task.poses, task.trained, trainer.gaussians, trainer.face, fine)
        if not order:
            order = [int(t) for t in rng.permutation(task.trained)]
        t, done = order.pop(), step / steps
        if trainer.offsets and done >= OFFSET_SHARE:
            trainer.fold_offsets()
            trainer.lay_unseen(coarse)
        loss = trainer.step(t, (coarse if step < coarse_until else fine)[t], done, rng.random(3), step)
        task.checkpoint(step + 1, steps, loss, trainer.gaussians)
        task.keep(step + 1, steps, partial(standing, step + 1, order, rng, trainer))
        task.progress(step + 1, steps, "steps")
    if trainer.offsets:
        trainer.fold_offsets()
    return trainer, fine, coarse


def coarse_steps(steps: int) -> int:
    """How many of the steps, the first, run at half the size."""
    return math.ceil(COARSE_SHARE * min(steps, STEPS))


def crops(task: Task) -> tuple[dict[int, View], dict[int, View]]:
    """The trained frames, cut to the person, at full and at half the size."""
    fine = {int(t): person_crop(task.views[t]) for t in task.trained}
    return fine, {t: v.halved() for t, v in fine.items()}


def start(task: Task, coarse: dict[int, View], count: int) -> Gaussians:
    """Gaussians spread over the body of the first frame, coloured from the frames; an offset of its surface is folded in."""
    faces, offset = task.poses.body.faces, task.poses.offset
    plain = task.poses.rest(int(task.trained[0]))[0]
    rest = plain + offset
    gaussians = Gaussians.area(rest, faces, count, task.config.seed)
    every = -(-len(task.trained) // COLOUR_FRAMES)
    frames = [PosedFrame(task.poses.vertices(int(t)), coarse[int(t)].camera, coarse[int(t)].pixels)
              for t in task.trained[::every]]
    sights = read_sights(frames, faces, gaussians)
    gaussians.light = find_light(sights, count) if task.config.light else None
    rgb, seen = mean_colours(sights, count, gaussians.light)
    gaussians.rgb = fill_unseen(rgb, seen, places(gaussians, rest, faces))
    if offset.any():
        gaussians, task.poses.offset = fold(gaussians, plain, offset, faces), np.zeros_like(offset)
    return gaussians


def largest(config: TrainConfig, count: int) -> float:
    """m, the longest axis that one of `count` gaussians may have."""
    return config.largest * max(1, LARGEST_OF / count) ** 0.5


def places(gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N, 3) m, centres of the gaussians on a mesh."""
    return bind(face_frames(rest, faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale).means


class Trainer:
    """Gaussians with Adam's state, and one step of the optimisation."""

    def __init__(self, gaussians: Gaussians, task: Task, settled: bool = False):
        """settled: the surface and the poses stay where they are."""
        self.config, self.poses = task.config, task.poses
        self.rest = task.poses.rest(int(task.trained[0]))[0]
        self.settled, self.pose_rate = settled, task.config.pose_rate
        self.offsets = None if settled else Offsets(task.poses.body)
        self.faces, self.face, self.light = task.poses.body.faces, gaussians.face, gaussians.light
        opacity = np.clip(gaussians.opacity, 1e-4, 1 - 1e-4)
        self.values = {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.log_scale,
                       "rgb": gaussians.rgb, "opacity": logit(opacity)[:, None]}
        self.values = {name: np.array(value, np.float32, order="C") for name, value in self.values.items()}
        self.first = {name: np.zeros(v.shape) for name, v in self.values.items()}
        self.second = {name: np.zeros(v.shape) for name, v in self.values.items()}
        self.count = np.zeros(len(self.face), np.int64)
        self.start, self.largest = self.values["mu"].copy(), largest(task.config, len(self.face))
        self.face_scale = face_frames(self.rest, self.faces).k[self.face].astype(np.float64)
        self.gains: dict[int, np.ndarray] = {}
        self.seen: np.ndarray | None = None
        """(N,) bool, once it is decided; the others are no longer moved."""
        self.workspace, self.losses = Workspace(), Workspace()

    @property
    def reach(self) -> float:
        """m that a gaussian may lie from its start."""
        return self.config.reach * (1 if self.seen is None else SETTLED_REACH)

    def state(self) -> dict:
        """For a checkpoint; poses aside."""
        return {name: getattr(self, name) for name in KEPT} | {
            "gains": {str(t): gain for t, gain in self.gains.items()},
            "offsets": self.offsets and self.offsets.state()}

    @classmethod
    def restored(cls, state: dict, task: Task) -> Trainer:
        """The trainer that gave this state."""
        v = state["values"]
        made = cls(Gaussians(state["face"], v["mu"], v["quat"], v["log_scale"], v["rgb"], sigmoid(v["opacity"][:, 0])), task)
        for name in KEPT:
            setattr(made, name, state[name])
        made.gains = {int(t): gain for t, gain in state["gains"].items()}
        if state["offsets"] is None:
            made.offsets = None
        else:
            made.offsets.restore(state["offsets"])
        return made

    def gaussians(self) -> Gaussians:
        v = self.values
        return Gaussians(self.face, v["mu"].copy(), v["quat"].copy(), v["log_scale"].copy(), v["rgb"].copy(),
                         sigmoid(v["opacity"][:, 0]), self.light)

    def step(self, t: int, view: View, done: float, background: np.ndarray, number: int) -> float:
        """One step on frame t. done: share of the steps so far; background: (3,). Returns the loss."""
        config = self.config
        loss, grads, opacity, grad_gain = self.gradients(t, view, background, number)
        self._move(grads, opacity, done)
        if not self.settled:
            grad_rest, grad_joints = self.poses.step(t, grads.vertices, self.pose_rate * 0.01**done, config.pose_pull)
            self._shape_body(t, grad_rest, grad_joints, done)
        if self.offsets:
            self.offsets.gather(grad_rest, OFFSET_RATE * 0.1 ** (done / OFFSET_SHARE))
            self.poses.offset = self.offsets.offset
        if config.exposure:
            gain = self.gains.get(t, np.ones(3))
            self.gains[t] = np.clip(gain - GAIN_RATE * np.sign(grad_gain) * 0.1**done, 0.5, 2).astype(np.float64)
        finite(f"after step {number}", self.values | {"offset of the surface": self.poses.offset, **pose(self.poses, t)})
        return loss

    def _shape_body(self, t: int, grad_rest: np.ndarray, grad_joints: np.ndarray, done: float) -> None:
        """One step of frame t's expression and of the joints at rest, where they are learned and the poses are."""
        config = self.config
        if config.expression_rate and self.pose_rate:
            self.poses.step_expression(t, self.poses.expression_gradient(grad_rest), config.expression_rate * 0.01**done,
                                       config.pose_pull)
        if config.joint_rate and self.pose_rate:
            self.poses.step_joints(grad_joints, config.joint_rate * 0.01**done, config.pose_pull)

    def gradients(self, t: int, view: View, background: np.ndarray, number: int):
        """Loss of frame t, its gradients, the opacities (N,) and the gradient of the frame's gain (3,)."""
        config, v = self.config, self.values
        vertices = self.poses.vertices(t)
        shown = Gaussians(self.face, v["mu"], v["quat"], v["log_scale"], v["rgb"], sigmoid(v["opacity"][:, 0]), self.light)
        rendering = render_bound(vertices, self.faces, shown, view.camera, self.workspace)
        background = background.astype(np.float32)
        gain = self.gains.get(t, np.ones(3)).astype(np.float32)
        image, target = np.empty_like(rendering.rgb), np.empty_like(rendering.rgb)
        on_background(rendering.rgb, rendering.alpha, view.pixels, background, gain, image, target)
        loss, grad_image = self._image_loss(image, target)
        grad_rgb, grad_alpha, grad_gain = np.empty_like(image), np.empty_like(rendering.alpha), np.empty(3)
        loss += through_background(grad_image, rendering.rgb, rendering.alpha, view.pixels, background, gain,
                                   config.mask, grad_rgb, grad_alpha, grad_gain)
        grads = render_bound_backward(rendering.state, grad_rgb, grad_alpha)
        finite(f"at step {number}", {"loss": loss, **gradients(grads)})
        return float(loss), grads, shown.opacity, grad_gain

    def fold_offsets(self) -> None:
        """From here on the gaussians themselves stand where the displaced body carried them."""
        folded = fold(self.gaussians(), self.rest, self.offsets.offset, self.faces)
        self.values |= {"mu": folded.mu, "quat": folded.quat, "log_scale": folded.log_scale}
        self.start = folded.mu.copy()
        self.poses.offset, self.offsets = np.zeros_like(self.poses.offset), None

    def lay_unseen(self, views: dict[int, View]) -> None:
        """Gaussians that no frame shows are laid among their neighbours, and stay there; none stands off the others.

        views: frame -> view at half the size.
        """
        gaussians = self.rest_unseen(views)
        gaussians = levelled(laid(gaussians, self.seen, self.rest, self.faces), self.rest, self.faces)
        opacity = np.clip(gaussians.opacity, 1e-4, 1 - 1e-4)
        self.values |= {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.log_scale, "rgb": gaussians.rgb,
                        "opacity": logit(opacity)[:, None].astype(np.float32)}
        self.start = gaussians.mu.copy()

    def rest_unseen(self, views: dict[int, View]) -> Gaussians:
        """The gaussians; from here on those that no frame shows stay as they are. views: frame -> view at half the size."""
        self.seen = self._seen(views)
        return self.gaussians()

    def recoloured(self, views: dict[int, View]) -> tuple[Gaussians, np.ndarray]:
        """The gaussians, none off the others, and which are seen (N,); where none is laid, the unseen as their neighbours."""
        gaussians, seen = self.gaussians(), self.seen
        if seen is None:
            seen = self._seen(views)
            gaussians.rgb = fill_unseen(gaussians.rgb, seen, places(gaussians, self.rest, self.faces))
        return levelled(gaussians, self.rest, self.faces), seen

    def _seen(self, views: dict[int, View]) -> np.ndarray:
        """(N,) bool, whether the frames show the gaussian's front."""
        gaussians = self.gaussians()

        def added(frame: tuple[int, View], workspace: Workspace) -> np.ndarray:
            t, view = frame
            return shown(gaussians, self.poses.vertices(t), self.faces, view.camera, workspace)

        pixels = sum(side_by_side(added, views.items()))
        return enough(pixels / len(views), gaussians, self.rest, self.faces)

    def _image_loss(self, image: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray]:
        config = self.config
        loss, gradient = losses.l2(image, target, workspace=self.losses)
        if config.ssim:
            similarity = losses.ssim(image, target, factor=-config.ssim, gradient=gradient, workspace=self.losses).value
            loss += config.ssim * (1 - similarity)
        if config.sobel:
            loss += config.sobel * losses.sobel(image, target, factor=config.sobel, gradient=gradient,
                                                workspace=self.losses).value
        return loss, gradient

    def _move(self, grads, opacity: np.ndarray, done: float) -> None:
        config, v = self.config, self.values
        rates = {"mu": config.mu_rate * 0.01**done, "quat": config.quat_rate * 0.1**done,
                 "log_scale": config.scale_rate * 0.1**done, "rgb": config.rgb_rate * 0.1**done,
                 "opacity": config.opacity_rate * 0.1**done}
        by_name = {"mu": grads.mu, "quat": grads.quat, "log_scale": grads.log_scale, "rgb": grads.rgb,
                   "opacity": (grads.opacity * opacity * (1 - opacity))[:, None]}
        if self.seen is not None:
            for grad in by_name.values():
                grad[~self.seen] = 0
        count_rows(by_name["rgb"], self.count)
        for name, rate in rates.items():
            adam_rows(v[name], by_name[name], self.first[name], self.second[name], self.count, rate)
        limit(v["mu"], v["quat"], v["log_scale"], v["rgb"], v["opacity"], self.start, self.face_scale, config.needle,
              self.largest, self.reach, config.place_pull * rates["mu"] / max(config.mu_rate, 1e-12))
