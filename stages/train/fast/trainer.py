"""The optimiser of recipe `fast` on the CPU: gaussians with Adam's state, one frame a step, poses refined on the way.

Two steps are worked out side by side, both from the gaussians as they stand, then taken one after the other: images are too small
to keep several cores busy with one, and a gradient that is late by one step teaches the same.

One gaussian budget from the start, no densification; half the size first; rates that decay; all poses corrected together before
the steps (`prealign`) and midway (`bundle_adjust`), each by itself from then on (`own_errors`, `newton`). Late steps also keep
outlines sharp from sides that no frame shows (`unseen_sides`). Gaussians are limited after every step instead of being penalised
in the loss: no needle, no giant and no floater can arise, whatever the weights.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gsac.avatar import losses
from gsac.avatar.binding import face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import opacity_logit, sigmoid
from gsac.avatar.raster import BoundGradients, render_bound, render_bound_backward
from gsac.avatar.threads import Workspace, kernel_threads, on_each, side_by_side
from gsac.stages.train.checkpoint import State
from gsac.stages.train.fast.initial_gaussians import centres_at_rest
from gsac.stages.train.fast.schedule import (
    END,
    GAIN_RATE,
    LATE_REACH,
    MU_END,
    OFFSET_RATE,
    OFFSET_SHARE,
    longest_axis,
    shortest_axis,
)
from gsac.stages.train.finite import named_gradients, named_pose, require_finite
from gsac.stages.train.gaussians.barely_seen import hold_barely_seen
from gsac.stages.train.gaussians.cloth_offsets import Offsets, fold
from gsac.stages.train.gaussians.first_colours import fill_unseen
from gsac.stages.train.gaussians.heights import level_heights
from gsac.stages.train.gaussians.joint_limits import TIE, limit_nowhere, limit_where_grown
from gsac.stages.train.gaussians.kernels import adam_rows, count_rows, limit, on_background, through_background
from gsac.stages.train.gaussians.shown import find_seen, front_pixels
from gsac.stages.train.gaussians.unseen import colour_unseen, flatten_unseen
from gsac.stages.train.poses.guessed_limbs import find_guessed_faces
from gsac.stages.train.poses.unseen_sides import SHARP, turned_vertices
from gsac.stages.train.task import Task
from gsac.stages.train.views import View

KEPT = ("face", "values", "first", "second", "count", "start", "largest", "tied", "light", "seen")
"""Attributes of Trainer that go into a checkpoint as they are."""
AT_ONCE = 2
"""Steps that are worked out side by side, on any number of cores: results shall not depend on it."""
EVIDENCE_FRAMES = 20
"""Frames at most, spread evenly, that tell how well a place is seen, once it is known which gaussians are seen at all."""


class Step(NamedTuple):
    """What a step is made on."""

    frame: int
    view: View
    done: float
    """Share of the steps so far."""
    background: np.ndarray
    """(3,) in 0..1."""
    number: int
    turn: np.ndarray | None = None
    """(3, 3) of a side that no frame shows: it teaches the gaussians' outline alone."""


class StepGradients(NamedTuple):
    loss: float
    values: dict[str, np.ndarray]
    """Name of a gaussian's value -> (N, ...)."""
    vertices: np.ndarray
    """(V, 3)."""
    gain: np.ndarray
    """(3,) of the frame's gain."""


class Room(NamedTuple):
    """Buffers that one frame's step works in."""

    drawing: Workspace
    losses: Workspace

    @classmethod
    def open(cls) -> Room:
        """Empty, with its share of the cores."""
        workers = max(1, kernel_threads() // AT_ONCE)
        return cls(Workspace(workers), Workspace(workers))


class Trainer:
    """Gaussians with Adam's state, and steps of the optimisation."""

    def __init__(self, gaussians: Gaussians, task: Task, frozen_body: bool = False, scale: float = 1.0):
        """frozen_body: the surface and the poses stay where they are, and no joint limits gaussians; scale: size that it is drawn
        at, of the images'.
        """
        self.config, self.poses = task.config, task.poses
        self.rest = task.poses.rest(int(task.trained[0]))[0]
        self.frozen_body, self.pose_rate = frozen_body, task.config.pose_rate
        self.offsets = None if frozen_body else Offsets(task.poses.body)
        self.faces, self.face, self.light = task.poses.body.faces, gaussians.face, gaussians.light
        self.low_pass = gaussians.low_pass
        self.values = learned_values(gaussians)
        self.first = {name: np.zeros(v.shape) for name, v in self.values.items()}
        self.second = {name: np.zeros(v.shape) for name, v in self.values.items()}
        self.count = np.zeros(len(self.face), np.int64)
        longest = longest_axis(task.config, len(self.face))
        limits = limit_nowhere(len(self.faces), longest) if frozen_body else limit_where_grown(task.growth, longest)
        self.start, self.largest, self.tied = self.values["mu"].copy(), limits.longest[self.face], limits.tied[self.face]
        self.least = shortest_axis(task, scale)
        self.face_scale = face_frames(self.rest, self.faces).k[self.face].astype(np.float64)
        self.gains: dict[int, np.ndarray] = {}
        self.seen: np.ndarray | None = None
        """(N,) bool, whether frames show the gaussian, once that is decided; the others no longer move."""
        self.guessed = find_guessed_faces(task.poses.body, task.poses.params.sigma_joints)
        """Frame -> (F,) bool, faces on limbs that are not where the frame shows them."""
        self.rooms: list[Room] = []
        """`AT_ONCE` from the first step on."""

    @property
    def reach(self) -> float:
        """m at rest that a gaussian may move away from its start."""
        return self.config.reach * (1 if self.seen is None else LATE_REACH)

    def state(self) -> State:
        """For a checkpoint, without the poses."""
        return {name: getattr(self, name) for name in KEPT} | {
            "gains": {str(t): gain for t, gain in self.gains.items()},
            "offsets": self.offsets and self.offsets.state()}

    @classmethod
    def from_state(cls, state: State, task: Task) -> Trainer:
        """The trainer that `state` was called on."""
        v = state["values"]
        made = cls(Gaussians(state["face"], v["mu"], v["quat"], v["log_scale"], v["rgb"], sigmoid(v["opacity_logit"][:, 0])), task)
        for name in KEPT:
            setattr(made, name, state[name])
        made.gains = {int(t): gain for t, gain in state["gains"].items()}
        if state["offsets"] is None:
            made.offsets = None
        else:
            made.offsets.restore(state["offsets"])
        return made

    def gaussians(self) -> Gaussians:
        """A copy of the gaussians as they stand."""
        return self._as_they_stand()[np.arange(len(self.face))]

    def learn(self, steps: list[Step]) -> list[float]:
        """Steps, at most `AT_ONCE`, each by the gradient of the values before the first of them. Returns their losses."""
        self.rooms = self.rooms or [Room.open() for _ in range(AT_ONCE)]
        gradients = on_each(self.rooms, self.gradients, steps)
        Workspace().share(self._advance, steps, gradients)
        if self.config.exposure:
            for step, grads in zip(steps, gradients, strict=True):
                if step.turn is not None:
                    continue
                gain = self.gains.get(step.frame, np.ones(3))
                self.gains[step.frame] = np.clip(gain - GAIN_RATE * np.sign(grads.gain) * 0.1**step.done, 0.5, 2).astype(np.float64)
        require_finite(f"after step {steps[-1].number}", self.values | {"offset of the surface": self.poses.offset} |
                       {name: value for step in steps for name, value in named_pose(self.poses, step.frame).items()})
        return [grads.loss for grads in gradients]

    def free_buffers(self) -> None:
        """Gives the steps' buffers back, hundreds of MB of large frames; the next step opens new ones."""
        self.rooms = []

    def _advance(self, worker: int, workers: int, steps: list[Step], gradients: list[StepGradients]) -> None:
        """A worker's share of the steps: the first one moves frames' bodies, where they are learned, the others the gaussians."""
        moves_body = worker == 0 and not self.frozen_body
        if workers > 1 and not self.frozen_body:
            worker, workers = worker - 1, workers - 1
        for step, grads in zip(steps, gradients, strict=True):
            if moves_body and step.turn is None:
                self._move_body(step.frame, grads.vertices, step.done)
            if worker >= 0:
                self._move(worker, workers, grads.values, step.done)

    def _move_body(self, t: int, grad_vertices: np.ndarray, done: float) -> None:
        """One step of frame t's pose and of the body's shape. grad_vertices: (V, 3)."""
        grad_rest, grad_joints = self.poses.step(t, grad_vertices, self.pose_rate * 0.01**done, self.config.pose_pull)
        if self.config.joint_rate and self.pose_rate:
            self.poses.step_joints(grad_joints, self.config.joint_rate * 0.01**done, self.config.pose_pull)
        if self.offsets:
            self.offsets.gather(grad_rest, OFFSET_RATE * 0.1 ** (done / OFFSET_SHARE))
            self.poses.offset = self.offsets.offset

    def gradients(self, step: Step, room: Room) -> StepGradients:
        """Of the loss of a frame, or of a side's outline; they lie in the room's buffers."""
        if step.turn is not None:
            return self._outline_gradients(step, step.turn, room)
        config, t, view = self.config, step.frame, step.view
        share, take = room.drawing.share, room.losses.take
        shown = self._as_they_stand()
        rendering = render_bound(self.poses.vertices(t), self.faces, shown, view.camera, room.drawing)
        background, gain = step.background.astype(np.float32), self.gains.get(t, np.ones(3)).astype(np.float32)
        real = rendering.rgb.dtype
        image, target, grad_rgb = (take(name, rendering.rgb.shape, real) for name in ("image", "target", "grad_rgb"))
        grad_alpha, spans = take("grad_alpha", rendering.alpha.shape, real), take("spans", (len(image), 2), np.int64)
        on_background(share, rendering.rgb, rendering.alpha, view.pixels, background, gain, image, target, spans)
        loss, grad_image = self._image_loss(image, target, spans, room.losses)
        grad_gain = np.empty(3)
        loss += through_background(share, grad_image, rendering.rgb, rendering.alpha, view.pixels, background, gain,
                                   config.mask, grad_rgb, grad_alpha, grad_gain)
        grads = render_bound_backward(rendering.state, grad_rgb, grad_alpha)
        require_finite(f"at step {step.number}", {"loss": loss, **named_gradients(grads)})
        by_name = self._by_name(grads, shown.opacity)
        if t in self.guessed:
            self._forget_guessed(t, by_name, grads.vertices)
        return StepGradients(float(loss), by_name, grads.vertices, grad_gain)

    def _outline_gradients(self, step: Step, turn: np.ndarray, room: Room) -> StepGradients:
        """Of the L2 between alpha, seen from a side, and its own outline. turn: (3, 3), the step's."""
        shown = self._as_they_stand()
        rendering = render_bound(turned_vertices(self.poses, step.frame, turn), self.faces, shown, step.view.camera, room.drawing)
        off = rendering.alpha - (rendering.alpha > 0.5)
        grad_rgb = room.losses.take("grad_rgb", rendering.rgb.shape, rendering.rgb.dtype)
        grad_rgb[:] = 0
        grads = render_bound_backward(rendering.state, grad_rgb, off * rendering.alpha.dtype.type(2 * SHARP / off.size))
        loss = SHARP * float(np.mean(off**2))
        require_finite(f"at step {step.number}", {"loss": loss, **named_gradients(grads)})
        return StepGradients(loss, self._by_name(grads, shown.opacity), grads.vertices, np.zeros(3))

    def _as_they_stand(self) -> Gaussians:
        """The gaussians, whose places, turns, sizes and colours are the trainer's own."""
        v = self.values
        return Gaussians(self.face, v["mu"], v["quat"], v["log_scale"], v["rgb"], sigmoid(v["opacity_logit"][:, 0]), self.light,
                         self.low_pass)

    def fold_offsets(self) -> None:
        """Moves the body's displacement into the gaussians: from here on they are bound to the plain body."""
        folded = fold(self.gaussians(), self.rest, self.offsets.offset, self.faces)
        self.values |= {"mu": folded.mu, "quat": folded.quat, "log_scale": folded.log_scale}
        self.start = folded.mu.copy()
        self.poses.offset, self.offsets = np.zeros_like(self.poses.offset), None

    def lay_unseen(self, views: dict[int, View]) -> None:
        """Lays gaussians that no frame shows flat among their neighbours and freezes them; levels the heights of all.

        views: frame -> view at half the size.
        """
        gaussians, pixels = self.gaussians(), self._front_pixels(views)
        frames = face_frames(self.rest, self.faces)
        self.seen = find_seen(pixels, gaussians, frames)
        laid = flatten_unseen(gaussians, self.seen, frames)
        laid.rgb = colour_unseen(gaussians, pixels, self.seen, frames, self.poses.body)
        gaussians = level_heights(laid, frames)
        self.values = learned_values(gaussians)
        self.start = gaussians.mu.copy()

    def finish(self, views: dict[int, View]) -> tuple[Gaussians, np.ndarray]:
        """The gaussians with their heights levelled, and seen (N,) bool; the less is seen of one, the more its neighbours' colour.

        views: frame -> view at half the size.
        """
        gaussians, seen = self.gaussians(), self.seen
        some = dict(list(views.items())[::math.ceil(len(views) / EVIDENCE_FRAMES)])
        pixels, frames = self._front_pixels(views if seen is None else some), face_frames(self.rest, self.faces)
        if seen is None:
            seen = find_seen(pixels, gaussians, frames)
            gaussians.rgb = fill_unseen(gaussians.rgb, seen, centres_at_rest(gaussians, self.rest, self.faces))
        if self.gains:  # drawn without a gain, the avatar is as bright as the frames are on average
            gaussians.rgb = np.clip(gaussians.rgb * np.mean(list(self.gains.values()), 0), 0, 1).astype(np.float32)
        gaussians.rgb = hold_barely_seen(gaussians, pixels, seen, frames)
        return level_heights(gaussians, frames), seen

    def _front_pixels(self, views: dict[int, View]) -> np.ndarray:
        """(N,) pixels that each gaussian shows of its front, mean over the frames."""
        gaussians = self.gaussians()

        def added(frame: tuple[int, View], workspace: Workspace) -> np.ndarray:
            t, view = frame
            return front_pixels(gaussians, self.poses.vertices(t), self.faces, view.camera, workspace)

        return sum(side_by_side(added, views.items()), np.zeros(len(self.face))) / len(views)

    def _image_loss(self, image: np.ndarray, target: np.ndarray, spans: np.ndarray,
                    workspace: Workspace) -> tuple[float, np.ndarray]:
        """Value and gradient (h, w, 3). image, target: (h, w, 3); spans: (h, 2) of `on_background`."""
        config = self.config
        gradient = workspace.take("gradient", image.shape, image.dtype)
        gradient[:] = 0
        loss, _ = losses.l2(image, target, gradient=gradient, workspace=workspace, spans=spans)
        if config.ssim:
            similarity = losses.ssim(image, target, factor=-config.ssim, gradient=gradient, workspace=workspace, spans=spans).value
            loss += config.ssim * (1 - similarity)
        if config.sobel:
            loss += config.sobel * losses.sobel(image, target, factor=config.sobel, gradient=gradient, workspace=workspace).value
        return loss, gradient

    def _by_name(self, grads: BoundGradients, opacity: np.ndarray) -> dict[str, np.ndarray]:
        """Name of a value -> its gradient (N, ...), zero where no frame shows the gaussian."""
        by_name = {"mu": grads.mu, "quat": grads.quat, "log_scale": grads.log_scale, "rgb": grads.rgb,
                   "opacity_logit": (grads.opacity * opacity * (1 - opacity))[:, None]}
        if self.seen is not None:
            for grad in by_name.values():
                grad[~self.seen] = 0
        return by_name

    def _forget_guessed(self, t: int, grads: dict[str, np.ndarray], grad_vertices: np.ndarray) -> None:
        """Zeroes what frame t would teach limbs that are not where it shows them. grads: (N, ...); grad_vertices: (V, 3)."""
        rows = self.guessed[t][self.face]
        for grad in grads.values():
            grad[rows] = 0
        grad_vertices[np.unique(self.faces[self.guessed[t]])] = 0

    def _move(self, worker: int, workers: int, grads: dict[str, np.ndarray], done: float) -> None:
        """One Adam step of a worker's share of the gaussians, then their limits. grads: (N, ...)."""
        config, v, n = self.config, self.values, len(self.face)
        own = slice(n * worker // workers, n * (worker + 1) // workers)
        rates = {"mu": config.mu_rate * MU_END**done, "quat": config.quat_rate * END**done,
                 "log_scale": config.scale_rate * END**done, "rgb": config.rgb_rate * END**done,
                 "opacity_logit": config.opacity_rate * END**done}
        bias = np.empty((own.stop - own.start, 2))
        count_rows(grads["rgb"][own], self.count[own], bias)
        for name, rate in rates.items():
            adam_rows(v[name][own], grads[name][own], self.first[name][own], self.second[name][own], bias, rate)
        limit(v["mu"][own], v["quat"][own], v["log_scale"][own], v["rgb"][own], v["opacity_logit"][own], self.start[own],
              self.face_scale[own], self.largest[own], self.tied[own], config.needle, self.least, self.reach, TIE,
              config.place_pull * rates["mu"] / max(config.mu_rate, 1e-12))


def learned_values(gaussians: Gaussians) -> dict[str, np.ndarray]:
    """A copy of what is learned of gaussians: name -> (N, ...) float32."""
    values = {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.log_scale, "rgb": gaussians.rgb,
              "opacity_logit": opacity_logit(gaussians.opacity)[:, None]}
    return {name: np.array(value, np.float32, order="C") for name, value in values.items()}
