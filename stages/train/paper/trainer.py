"""Recipe `paper`: the first stage of HAHA (Svitov et al. 2024) as GSAC uses it; the baseline that `fast` is measured against.

One gaussian a face, random colours, opacity fixed, four frames a step, densification by the gradient of the image places, pose
and betas learned. Everything is computed on the person's box but scaled to the whole frame: outside of the box render and frame
are the same background. Known departures, all of them small: neighbours and their distances are taken at rest; jaw and expression
stay as fitted (their rate could move them by 0.015 at most); each frame's pose has Adam moments of its own. LPIPS is in the loss
where the user has brought its network: no package has it, and it takes nearly all of the time.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from gsac.avatar import losses
from gsac.avatar.binding import face_frames
from gsac.avatar.draw_rule import ADDED
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import sigmoid
from gsac.avatar.raster import BoundGradients, render_bound, render_bound_backward, screen_gradients
from gsac.avatar.threads import Workspace
from gsac.stages.train.checkpoint import State, loop_state
from gsac.stages.train.finite import named_gradients, named_pose, require_finite
from gsac.stages.train.gaussians.kernels import adam, on_background, through_background
from gsac.stages.train.paper.densify import LARGEST, Densifier
from gsac.stages.train.paper.knn import Neighbours
from gsac.stages.train.paper.losses import dice, perceptual, sobel_magnitude
from gsac.stages.train.task import LPIPS_WEIGHT, Fit, Task
from gsac.stages.train.views import View, person_crop

STEPS = 3000
BATCH = 4
SCALE_LOGITS, OPACITY_LOGIT = (-1.0, -2.0, -1.0), 6.0
MU_RATE, MU_DECAY = 1.6e-4, 0.01
RATES = {"rgb": 5e-3, "quat": 5e-3, "scale_logit": 5e-3}
POSE_RATE = 2e-4
"""Of orientation, body pose, translation and betas; the hands' is a tenth (`Poses`)."""
SSIM, SOBEL, KNN, DICE = 0.1, 1.0, 0.01, 0.1
"""Weights of the losses beside L2."""
KEPT = ("face", "values", "first", "second")
"""Attributes of Trainer that go into a checkpoint as they are."""


def fit(task: Task) -> Fit:
    """The whole training. Raises StageError that names the step and the quantity that is no longer finite."""
    steps = task.config.steps or STEPS
    rng = np.random.default_rng(task.config.seed)
    views = {int(t): person_crop(task.views[t]) for t in task.trained}
    trainer = Trainer(task, rng)
    batch = min(BATCH, len(task.trained))
    order: list[int] = []
    begin = 0
    if task.resumed is not None:
        trainer.restore(task.resumed["trainer"])
        begin, order, rng.bit_generator.state = (task.resumed[name] for name in ("step", "order", "rng"))
    for step in range(begin, steps):
        if len(order) < batch:  # what is left of the last round is dropped
            order = [int(t) for t in rng.permutation(task.trained)]
        frames, order = order[:batch], order[batch:]
        loss = trainer.step({t: views[t] for t in frames}, step, steps)
        trainer.densifier.grow(step, trainer, rng)
        task.checkpoint(step + 1, steps, loss, trainer.gaussians)
        task.keep(step + 1, steps, partial(loop_state, step + 1, order, rng, trainer))
        task.progress(step + 1, steps, "steps")
    return Fit(trainer.gaussians(), np.ones(len(trainer.face), bool))


class Trainer:
    """The gaussians, their Adam state, and one step."""

    def __init__(self, task: Task, rng: np.random.Generator):
        self.poses, self.faces = task.poses, task.poses.body.faces
        self.frames = face_frames(task.poses.rest(int(task.trained[0]))[0], self.faces)
        count = len(self.faces)
        self.face = np.arange(count, dtype=np.int32)
        self.values = {"mu": np.zeros((count, 3)), "quat": np.tile([1.0, 0, 0, 0], (count, 1)),
                       "scale_logit": np.tile(SCALE_LOGITS, (count, 1)), "rgb": rng.random((count, 3))}
        self.values = {name: value.astype(np.float32) for name, value in self.values.items()}
        self.first = {name: np.zeros_like(v) for name, v in self.values.items()}
        self.second = {name: np.zeros_like(v) for name, v in self.values.items()}
        self.frame_size = task.views[0].frame.width, task.views[0].frame.height
        self.lpips = task.lpips
        self.densifier = Densifier(count)
        self.neighbours = Neighbours()
        self.workspace, self.losses = Workspace(), Workspace()
        self.rng = rng

    def state(self) -> State:
        """For a checkpoint, without the poses."""
        return {name: getattr(self, name) for name in KEPT} | {
            "frames": self.frames._asdict(), "neighbours": self.neighbours.index,
            "length": self.densifier.length, "hits": self.densifier.hits}

    def restore(self, state: State) -> None:
        """Takes the place of the trainer that `state` was called on."""
        for name in KEPT:
            setattr(self, name, state[name])
        self.frames, self.neighbours.index = self.frames._replace(**state["frames"]), state["neighbours"]
        self.densifier.length, self.densifier.hits = state["length"], state["hits"]

    def gaussians(self) -> Gaussians:
        """A copy as they stand: rotations of length one, colours in 0..1."""
        shown = self.shown()
        return Gaussians(self.face, shown.mu.copy(), shown.quat / np.linalg.norm(shown.quat, axis=1, keepdims=True),
                         shown.log_scale, np.clip(shown.rgb, 0, 1), shown.opacity, low_pass=ADDED)

    def shown(self) -> Gaussians:
        """The gaussians as they are drawn while training."""
        v = self.values
        opacity = np.full(len(self.face), sigmoid(OPACITY_LOGIT), np.float32)
        return Gaussians(self.face, v["mu"], v["quat"], np.log(LARGEST) - np.log1p(np.exp(-v["scale_logit"])), v["rgb"],
                         opacity, low_pass=ADDED)

    def step(self, views: dict[int, View], number: int, steps: int) -> float:
        """Step `number` of `steps` on a batch: frame -> view. Returns its loss without the neighbour term."""
        shown, share = self.shown(), 1 / len(views)
        total, loss = {name: np.zeros_like(v) for name, v in self.values.items()}, 0.0
        moves = {}
        for t, view in views.items():
            value, grads = self._image(t, view, shown, share)
            require_finite(f"at step {number}", named_gradients(grads))
            loss += value
            total["mu"] += grads.mu
            total["quat"] += grads.quat
            total["scale_logit"] += grads.log_scale / (1 + np.exp(self.values["scale_logit"]))
            total["rgb"] += grads.rgb
            moves[t] = grads.vertices.copy()
        self._pull_together(total, number)
        require_finite(f"at step {number}",
                       {"loss": loss, **{f"gradient of {name}": gradient for name, gradient in total.items()}})
        rates = RATES | {"mu": MU_RATE * MU_DECAY ** (number / steps)}
        for name, rate in rates.items():
            adam(self.values[name], total[name], self.first[name], self.second[name], number + 1, rate)
        betas = np.zeros(len(self.poses.betas))
        for t, grad_vertices in moves.items():
            betas += self.poses.shape_gradient(*self.poses.step(t, grad_vertices, POSE_RATE, 0.0))
            require_finite(f"after step {number}", named_pose(self.poses, t))
        self.poses.step_betas(betas, POSE_RATE)
        require_finite(f"after step {number}", self.values | {"betas": self.poses.betas})
        return float(loss)

    def append(self, parents: np.ndarray, new: dict[str, np.ndarray]) -> None:
        """As `densify.Growable.append`. parents: (n,); new: name -> (n, C)."""
        self.face = np.concatenate([self.face, self.face[parents]])
        for name, rows in new.items():
            self.values[name] = np.concatenate([self.values[name], rows])
            for moments in (self.first, self.second):
                moments[name] = np.concatenate([moments[name], np.zeros_like(rows)])

    def _image(self, t: int, view: View, shown: Gaussians, share: float) -> tuple[float, BoundGradients]:
        """Loss of one frame times its share of the batch, and its gradients."""
        vertices = self.poses.vertices(t)
        rendering = render_bound(vertices, self.faces, shown, view.camera, self.workspace)
        background = self.rng.random(3).astype(np.float32)
        image, target = np.empty_like(rendering.rgb), np.empty_like(rendering.rgb)
        gain, grad_gain = np.ones(3, np.float32), np.empty(3)
        on_background(rendering.rgb, rendering.alpha, view.pixels, background, gain, image, target)
        frame = self.frame_size[0] * self.frame_size[1]
        part = share * rendering.alpha.size / frame  # a mean over the box as its part of the mean over the whole frame
        loss, gradient = losses.l2(image, target, factor=part, workspace=self.losses)
        loss *= part
        similarity = losses.ssim(image, target, factor=-SSIM * part, gradient=gradient, workspace=self.losses).value
        loss += SSIM * part * (1 - similarity)
        loss += sobel_magnitude(image, target, SOBEL * share / frame, gradient)
        if self.lpips is not None:
            centre = view.camera.project(vertices[[self.rng.integers(len(vertices))]])[0] + view.corner
            loss += perceptual(self.lpips, image, target, background, np.array(view.corner), self.frame_size, centre,
                               LPIPS_WEIGHT * share, gradient)
        grad_rgb, grad_alpha = np.empty_like(image), np.empty_like(rendering.alpha)
        through_background(gradient, rendering.rgb, rendering.alpha, view.pixels, background, gain, 0.0, grad_rgb, grad_alpha,
                           grad_gain)
        loss += dice(rendering.alpha, view.pixels, frame - rendering.alpha.size, DICE * share, grad_alpha)
        grads = render_bound_backward(rendering.state, grad_rgb, grad_alpha)
        places, visible = screen_gradients(rendering.state)
        self.densifier.note(places * np.array(self.frame_size) / 2, visible)
        return loss, grads

    def _pull_together(self, total: dict[str, np.ndarray], number: int) -> None:
        """Adds the gradients of the neighbour term."""
        v = self.values
        turn, k = self.frames.R[self.face], self.frames.k[self.face, None]
        places = self.frames.T[self.face] + k * np.einsum("nij,nj->ni", turn, v["mu"])
        grad_places = self.neighbours.distance_gradient(places, KNN, number)
        total["mu"] += k * np.einsum("nji,nj->ni", turn, grad_places)
        act = LARGEST / (1 + np.exp(-v["scale_logit"]))
        total["scale_logit"] += self.neighbours.spread_gradient(act, KNN) * act * (1 - act / LARGEST)
        for name in ("quat", "rgb"):
            total[name] += self.neighbours.spread_gradient(v[name], KNN)
