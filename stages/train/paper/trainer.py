"""Recipe `paper`: the first stage of HAHA (Svitov et al. 2024) as GSAC trains by it; the baseline that `fast` is measured against.

One gaussian a face, random colours, opacity fixed, four frames a step, densification by the gradient of the image places, poses
with jaw and expression, and betas learned; losses, neighbours, Adam and growth as in the published code, of which the text of the
paper differs (`train.paper_text`). Only the box of a square frame that can show the person is computed. Known departures:

- gaussians are drawn by our rule (avatar/draw_rule.py): alpha up to 0.999, in the published rasteriser 0.99, and as far as it
  reaches, there three deviations;
- gradients are exact; where the background shows through, those of the published rasteriser are not: it takes the background's red
  for green and blue, and has a slope of its own by alpha, which Dice alone has a part in (benchmarks/gpu/published/splats.py);
- the body has our number of betas, expressions and joints' correctives, and poses come from our own fit;
- masks are soft; images have the size of `train.height`, the published ones are 1080 px wide;
- the colours that are handed out are clipped to 0..1.

LPIPS is in the loss where the user has brought its network: no package has it, and on a CPU it takes nearly all of the time.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import bind_backward
from gsac.avatar.draw_rule import ADDED
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import sigmoid
from gsac.avatar.raster import BoundGradients, Rendering, render_backward, render_bound, screen_gradients
from gsac.avatar.threads import Workspace
from gsac.stages.train.checkpoint import State
from gsac.stages.train.finite import named_gradients, named_pose, require_finite
from gsac.stages.train.gaussians.kernels import adam
from gsac.stages.train.paper.batches import Batches, draw_batches
from gsac.stages.train.paper.body_adam import BodyAdam
from gsac.stages.train.paper.densify import LARGEST, Densifier
from gsac.stages.train.paper.knn import pull_together
from gsac.stages.train.paper.losses import Picture, dice, picture_loss
from gsac.stages.train.paper.square import side_of, square_crop
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import View

STEPS = 3000
BATCH = 4
SCALE_LOGITS, OPACITY_LOGIT = (-1.0, -2.0, -1.0), 6.0
MU_RATE, MU_DECAY = 1.6e-4, 0.01
RATES = {"rgb": 5e-3, "quat": 5e-3, "scale_logit": 5e-3}
KNN = 0.01
"""Weight of the neighbour term beside L2."""
KEPT = ("face", "values", "first", "second")
"""Attributes of Trainer that go into a checkpoint as they are."""


def fit(task: Task) -> Fit:
    """The whole training. Raises StageError that names the step and the quantity that is no longer finite."""
    rng = np.random.default_rng(task.config.seed)
    views, batches = crop_views(task), plan_batches(task)
    trainer = Trainer(task, rng)
    steps, begin = len(batches.order), 0
    if task.resumed is not None:
        trainer.restore(task.resumed["trainer"])
        begin, rng.bit_generator.state = task.resumed["step"], task.resumed["rng"]
    for step in range(begin, steps):
        frames = [int(t) for t in task.trained[batches.order[step]]]
        loss = trainer.step({t: views[t] for t in frames}, step, steps, batches.background[step], batches.centre[step])
        trainer.densifier.grow(step, trainer, rng)
        task.checkpoint(step + 1, steps, loss, trainer.gaussians)
        task.keep(step + 1, steps, lambda done=step + 1: {"step": done, "rng": rng.bit_generator.state, "trainer": trainer.state()})
        task.progress(step + 1, steps, "steps")
    return Fit(trainer.gaussians(), np.ones(len(trainer.face), bool))


def crop_views(task: Task) -> dict[int, View]:
    """Trained frame -> the part of its square frame that is computed."""
    side = side_of(task.views)
    return {int(t): square_crop(task.views[t], side, task.poses.vertices(t)) for t in task.trained}


def plan_batches(task: Task) -> Batches:
    """What the steps of the task see."""
    vertices = len(task.poses.body.v_template)
    return draw_batches(len(task.trained), min(BATCH, len(task.trained)), task.config.steps or STEPS, vertices, task.config.seed)


def mu_rates(steps: int) -> np.ndarray:
    """(steps,) Adam rates of the places: HAHA's scheduler is one step ahead."""
    return MU_RATE * MU_DECAY ** (np.arange(1, steps + 1) / steps)


class Trainer:
    """The gaussians, their Adam state, and one step."""

    def __init__(self, task: Task, rng: np.random.Generator):
        self.poses, self.faces, self.text = task.poses, task.poses.body.faces, task.config.paper_text
        count = len(self.faces)
        self.face = np.arange(count, dtype=np.int32)
        self.values = {"mu": np.zeros((count, 3)), "quat": np.tile([1.0, 0, 0, 0], (count, 1)),
                       "scale_logit": np.tile(SCALE_LOGITS, (count, 1)), "rgb": rng.random((count, 3))}
        self.values = {name: value.astype(np.float32) for name, value in self.values.items()}
        self.first = {name: np.zeros_like(v) for name, v in self.values.items()}
        self.second = {name: np.zeros_like(v) for name, v in self.values.items()}
        self.side, self.network = side_of(task.views), task.network
        self.densifier, self.body = Densifier(count), BodyAdam(task.poses)
        self.workspaces = [Workspace() for _ in range(min(BATCH, len(task.trained)))]
        self.losses = Workspace()

    def state(self) -> State:
        """For a checkpoint, without the poses."""
        return {name: getattr(self, name) for name in KEPT} | {
            "body": self.body.state(), "length": self.densifier.length, "hits": self.densifier.hits}

    def restore(self, state: State) -> None:
        """Takes the place of the trainer that `state` was called on."""
        for name in KEPT:
            setattr(self, name, state[name])
        self.body.restore(state["body"])
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

    def step(self, views: dict[int, View], number: int, steps: int, backgrounds: np.ndarray, centres: np.ndarray) -> float:
        """Step `number`, from 0, of `steps` on a batch: frame -> view. Returns its loss.

        backgrounds: (B, 3) in 0..1; centres: (B,) vertices in the middle of the windows that LPIPS sees.
        """
        shown = self.shown()
        total = {name: np.zeros_like(v) for name, v in self.values.items()}
        vertices = {t: self.poses.vertices(t) for t in views}
        renderings = {t: render_bound(vertices[t], self.faces, shown, view.camera, workspace)
                      for (t, view), workspace in zip(views.items(), self.workspaces, strict=False)}
        pictures = {t: Picture(renderings[t].rgb, renderings[t].alpha, view.pixels, background, view.corner, self.side)
                    for (t, view), background in zip(views.items(), backgrounds, strict=True)}
        loss, slope = (0.0, 0.0) if self.text else dice(list(pictures.values()))
        moves = {}
        for (t, view), vertex in zip(views.items(), centres, strict=True):
            centre = view.camera.project(vertices[t][vertex]) + view.corner
            value, grads = self._gradients(renderings[t], pictures[t], centre, slope, 1 / len(views), number)
            require_finite(f"at step {number}", named_gradients(grads))
            loss += value
            for name, gradient in (("mu", grads.mu), ("quat", grads.quat), ("rgb", grads.rgb),
                                   ("scale_logit", grads.log_scale / (1 + np.exp(self.values["scale_logit"])))):
                total[name] += gradient
            moves[t] = grads.vertices
        require_finite(f"at step {number}",
                       {"loss": loss, **{f"gradient of {name}": gradient for name, gradient in total.items()}})
        for name, rate in (RATES | {"mu": float(mu_rates(steps)[number])}).items():
            adam(self.values[name], total[name], self.first[name], self.second[name], number + 1, rate)
        self.body.step(moves)
        for t in moves:
            require_finite(f"after step {number}", named_pose(self.poses, t))
        require_finite(f"after step {number}", self.values | {"betas": self.poses.betas})
        return float(loss)

    def append(self, parents: np.ndarray, new: dict[str, np.ndarray]) -> None:
        """As `densify.Growable.append`. parents: (n,); new: name -> (n, C)."""
        self.face = np.concatenate([self.face, self.face[parents]])
        for name, rows in new.items():
            self.values[name] = np.concatenate([self.values[name], rows])
            for moments in (self.first, self.second):
                moments[name] = np.concatenate([moments[name], np.zeros_like(rows)])

    def _gradients(self, rendering: Rendering, picture: Picture, centre: np.ndarray, slope: float, share: float,
                   number: int) -> tuple[float, BoundGradients]:
        """Loss of one frame times its share of the batch, and its gradients and those of the batch's Dice (slope)."""
        state = rendering.state
        loss, grad_rgb, grad_alpha = picture_loss(picture, share, self.text, self.losses, self.network, centre)
        grad_alpha += np.float32(slope) * (1 - picture.mask)
        grads = render_backward(state, grad_rgb, grad_alpha)
        places, visible = screen_gradients(state)
        self.densifier.note(number, places * self.side / 2, visible)
        pull = pull_together(state.means, state.rotations, state.scales, self.values["rgb"], KNN * share)
        vertices, faces, face, mu, quat, log_scale = state.bound
        bound = bind_backward(vertices, faces, face, mu, quat, log_scale, grads.means + pull.places,
                              grads.rotations + pull.rotations, grads.scales + pull.scales)
        return loss + pull.value, BoundGradients(bound.mu, bound.quat, bound.log_scale, grads.rgb + pull.rgb, grads.opacity,
                                                 bound.vertices)
