"""The baseline: recipe fast in torch and gsplat. Skinning, binding, gsplat's rasteriser, L2 + SSIM + Sobel + mask, Adam, poses too.

It has no displaced surface and no limits on gaussians, each of which would cost it more launches.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch.nn import functional

from gsac.avatar.cuda.adjacency import joint_levels
from gsac.avatar.cuda.arrays import BodyArrays, Shot
from gsac.avatar.cuda.recipe import Recipe, draw_plan
from gsac.avatar.draw_rule import BRIGHTEST, DARKEST
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY, JAW_EYES
from gsac.avatar.light import FROM_CAMERA
from gsac.avatar.logistic import logit, sigmoid
from gsac.benchmarks.gpu.synthetic_clip import Figure
from gsac.stages.train.fast import prealign
from gsac.stages.train.fast.cuda import Cuda, make_recipe
from gsac.stages.train.fast.initial_gaussians import crop_views, init_gaussians
from gsac.stages.train.fast.schedule import budget
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.gpu import body_arrays
from gsac.stages.train.poses.poses import HAND_SHARE
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import View, of_each

RATES = {"mu": "mu_rate", "quat": "quat_rate", "log_scale": "scale_rate", "rgb": "rgb_rate", "opacity": "opacity_rate",
         "pose": "pose_rate"}
"""Group of the optimiser -> name of its rate in `Recipe`."""


def tensor(array: ArrayLike, dtype: torch.dtype = torch.float32) -> torch.Tensor:
    """Copies an array (...,) to the GPU."""
    return torch.as_tensor(np.ascontiguousarray(array), dtype=dtype, device="cuda")


def seconds_per_step(figure: Figure, gaussians: Gaussians, recipe: Recipe, compiled: bool, steps: int = 60,
                     warm: int = 20) -> float:
    """Seconds of a step of one frame, by device events. compiled: skinning, binding and losses run by torch.compile."""
    loop = TorchTrainer(figure.body, figure.pose, figure.transl, gaussians, recipe, compiled)
    shots = on_device(figure.shots)
    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    for step in range(warm + steps):
        if step == warm:
            torch.cuda.synchronize()
            begin.record()
        loss = loop.step(shots[step % len(shots)], step % len(shots), torch.rand(3, device="cuda"))
    end.record()
    torch.cuda.synchronize()
    if not torch.isfinite(loss):
        raise RuntimeError("the baseline's loss is not finite")
    return begin.elapsed_time(end) / steps / 1e3


def fit(task: Task) -> Fit:
    """Recipe fast for the stage, eager, with the frames, sizes, backgrounds and rates of the CUDA trainer."""
    prealign.adjust(task, Cuda())
    fine = crop_views(task)
    coarse = of_each(View.halved, fine)
    gaussians = init_gaussians(task, coarse, budget(task, "cuda"))
    recipe = make_recipe(task.config, len(gaussians))
    levels = [on_device([Shot(views[int(t)].pixels, views[int(t)].camera) for t in task.trained]) for views in (coarse, fine)]
    poses = task.poses
    loop = TorchTrainer(body_arrays(poses, task.trained, recipe), poses.pose[task.trained], poses.transl[task.trained], gaussians,
                        recipe)
    plan = draw_plan(recipe, len(task.trained), 2)
    backgrounds, seconds, done = tensor(plan.background[:, 0]), 0.0, 0
    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    for mark in [*(m for m in task.marks(recipe.steps) if m < recipe.steps), recipe.steps]:
        begin.record()
        for step in range(done, mark):
            t = int(plan.order[step, 0])
            loss = loop.step(levels[plan.rates["level"][step]][t], t, backgrounds[step], plan.rates[step])
        end.record()
        torch.cuda.synchronize()
        seconds += begin.elapsed_time(end) / 1e3
        poses.pose[task.trained], poses.transl[task.trained] = loop.poses()
        task.checkpoint(mark, recipe.steps, float(loss), loop.gaussians, seconds)
        done = mark
    return Fit(*Trainer(loop.gaussians(), task, frozen_body=True).finish(coarse))


def on_device(shots: list[Shot]) -> list[tuple]:
    """Pixels (h, w, 4) uint8, intrinsics (1, 3, 3), width and height of each shot, on the GPU."""
    out = []
    for shot in shots:
        c = shot.camera
        lens = tensor([[c.focal[0], 0, c.center[0]], [0, c.focal[1], c.center[1]], [0, 0, 1]])[None]
        out.append((tensor(shot.pixels, torch.uint8), lens, c.width, c.height))
    return out


class TorchTrainer:
    """Values, poses and optimiser on the GPU. pose: (T, 55, 3) rad; transl: (T, 3) m."""

    def __init__(self, body: BodyArrays, pose: np.ndarray, transl: np.ndarray, gaussians: Gaussians, recipe: Recipe,
                 compiled: bool = False):
        from gsplat import rasterization

        self.rasterization, self.face, self.light = rasterization, gaussians.face, gaussians.light
        self.eye = torch.eye(4, device="cuda")[None]
        self.geometry, self.loss = _make_geometry(body, gaussians.face, gaussians.light), _make_loss(recipe)
        if compiled:
            self.geometry, self.loss = torch.compile(self.geometry), torch.compile(self.loss)
        opacity = np.clip(gaussians.opacity, 1e-4, 1 - 1e-4)
        given = (gaussians.mu, gaussians.quat, gaussians.log_scale, gaussians.rgb, logit(opacity))
        self.values = [tensor(a).requires_grad_() for a in given]
        self.fitted = tensor(np.concatenate([pose, transl[:, None]], 1))
        # each frame's change from the fit has its own Adam state; `share` slows fingers and fixes jaw and eyes
        self.moved = [torch.zeros_like(p).requires_grad_() for p in self.fitted]
        self.share = torch.full((56, 1), HAND_SHARE, device="cuda")
        self.share[BODY], self.share[JAW_EYES], self.share[55] = 1, 0, 1
        groups = [{"params": p, "lr": getattr(recipe, rate)}
                  for p, rate in zip([*([v] for v in self.values), self.moved], RATES.values(), strict=True)]
        self.optimiser = torch.optim.Adam(groups, betas=(0.9, 0.99), fused=True)

    def step(self, shot: tuple, t: int, background: torch.Tensor, rates: np.ndarray | None = None) -> torch.Tensor:
        """Takes a step on frame t.

        shot: of `on_device`; background: (3,); rates: scalar record of `recipe.draw`. Returns the loss, scalar, on the GPU.
        """
        if rates is not None:
            for group, name in zip(self.optimiser.param_groups, RATES, strict=True):
                group["lr"] = float(rates[name])
        loss, _, _ = self.evaluate(self.fitted[t] + self.share * self.moved[t], shot, background)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        return loss.detach()

    def evaluate(self, placed: torch.Tensor, shot: tuple,
                 background: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Loss, rgb (h, w, 3) and alpha (h, w, 1) of a frame. placed: (56, 3), pose and translation; background: (3,)."""
        pixels, lens, width, height = shot
        mu, quat, log_scale, rgb, opacity = self.values
        means, covars, shade = self.geometry(placed, mu, quat, log_scale)
        drawn, alpha, _ = self.rasterization(means, None, None, opacity.sigmoid(), shade * rgb, self.eye, lens, width, height,
                                             packed=False, covars=covars)
        return self.loss(drawn[0], alpha[0], pixels, background), drawn[0], alpha[0]

    def gaussians(self) -> Gaussians:
        """The gaussians as they are now."""
        mu, quat, log_scale, rgb, logits = (v.detach().cpu().numpy() for v in self.values)
        return Gaussians(self.face, mu, quat, log_scale, np.clip(rgb, 0, 1), sigmoid(logits), self.light)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Pose (T, 55, 3) rad and translation (T, 3) m as they are now."""
        both = (self.fitted + self.share * torch.stack(self.moved)).detach().cpu().numpy()
        return both[:, :55], both[:, 55]


def _make_geometry(body: BodyArrays, face: np.ndarray, light: np.ndarray | None) -> Callable:
    """Makes (pose and translation (56, 3), mu, quat, log_scale) -> means (N, 3), covariances (N, 3, 3), shades (N, 3).

    The shade is 1 without a light (4, 3). Uses the first rest shape.
    """
    rest, joints = tensor(body.rest[0]), tensor(body.joints)
    parents = np.asarray(body.parents)
    levels = joint_levels(parents)
    skin_index, skin_weight = tensor(body.skin_index, torch.long), tensor(body.skin_weight)
    corner = tensor(np.asarray(body.faces)[face], torch.long)
    by_level = [tensor(np.flatnonzero(levels == k), torch.long) for k in range(levels.max() + 1)]
    above = [tensor(parents[np.flatnonzero(levels == k)], torch.long) for k in range(levels.max() + 1)]

    lamps = None if light is None else tensor(light * np.array([1, *FROM_CAMERA[:2], 1])[:, None])

    def shade_of(n):
        if lamps is None:
            return 1.0
        return (lamps[0] + n[:, :2] @ lamps[1:3] + n[:, 2:].abs() @ lamps[3:]).clamp(DARKEST, BRIGHTEST)

    def geometry(placed, mu, quat, log_scale):
        pose, transl = placed[:55], placed[55]
        t = pose.norm(dim=1).clamp(min=1e-8)[:, None, None]
        x, y, z = (pose / t[:, 0]).unbind(1)
        zero = torch.zeros_like(x)
        k = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], 1).reshape(-1, 3, 3)
        local = torch.eye(3, device="cuda") + t.sin() * k + (1 - t.cos()) * k @ k
        turn, place = torch.zeros_like(local), torch.zeros_like(joints)
        turn = turn.index_copy(0, by_level[0], local[by_level[0]])
        place = place.index_copy(0, by_level[0], joints[by_level[0]])
        for own, up in zip(by_level[1:], above[1:], strict=True):
            place = place.index_copy(0, own, place[up] + (turn[up] @ (joints[own] - joints[up])[..., None])[..., 0])
            turn = turn.index_copy(0, own, turn[up] @ local[own])
        shift = place - (turn @ joints[..., None])[..., 0]
        mixed, moved = (skin_weight[..., None, None] * turn[skin_index]).sum(1), (skin_weight[..., None] * shift[skin_index]).sum(1)
        vertices = (mixed @ rest[..., None])[..., 0] + moved + transl
        v0, v1, v2 = vertices[corner].unbind(1)
        cross = torch.linalg.cross(v2 - v1, v0 - v1)
        area2, side = cross.norm(dim=1).clamp(min=1e-12), (v0 - v2).norm(dim=1)
        a, n = functional.normalize(v2 - v1, dim=1), cross / area2[:, None]
        axes = torch.stack([a, n, torch.linalg.cross(a, n)], 2)
        size = 10 * (area2 / side + side)
        w, i, j, k = functional.normalize(quat, dim=1).unbind(1)
        own = torch.stack([1 - 2 * (j * j + k * k), 2 * (i * j - w * k), 2 * (i * k + w * j), 2 * (i * j + w * k),
                           1 - 2 * (i * i + k * k), 2 * (j * k - w * i), 2 * (i * k - w * j), 2 * (j * k + w * i),
                           1 - 2 * (i * i + j * j)], 1).reshape(-1, 3, 3)
        half = axes @ own * (size[:, None] * log_scale.exp())[:, None]
        means = size[:, None] * (axes @ mu[..., None])[..., 0] + (v0 + v1 + v2) / 3
        return means, half @ half.transpose(1, 2), shade_of(n.detach())

    return geometry


def _make_loss(recipe: Recipe) -> Callable:
    """Makes (rgb (h, w, 3) premultiplied, alpha (h, w, 1), pixels (h, w, 4) uint8, background (3,)) -> loss."""
    window = torch.exp(-torch.arange(-5, 6, device="cuda") ** 2 / (2 * 1.5**2))
    window = window / window.sum()
    sobel = tensor(np.outer([1, 2, 1], [-1, 0, 1]) / 4)
    filters = torch.stack([sobel, sobel.T])[:, None].repeat(3, 1, 1, 1)

    def blur(images):
        flat = images.reshape(-1, 1, *images.shape[-2:])
        flat = functional.conv2d(flat, window.view(1, 1, 1, 11), padding=(0, 5))
        flat = functional.conv2d(flat, window.view(1, 1, 11, 1), padding=(5, 0))
        return flat.reshape(images.shape)

    def loss(rgb, alpha, pixels, background):
        truth = pixels.float() / 255
        image = (rgb + (1 - alpha) * background).permute(2, 0, 1)
        target = (truth[..., :3] + (1 - truth[..., 3:]) * background).permute(2, 0, 1)
        mx, my, q, p = blur(torch.stack([image, target, image**2 + target**2, image * target]))
        squares, product = mx * mx + my * my, mx * my
        similarity = (2 * product + 1e-4) * (2 * (p - product) + 9e-4) / ((squares + 1e-4) * (q - squares + 9e-4))
        out = (functional.mse_loss(image, target) + recipe.ssim * (1 - similarity.mean())
               + recipe.mask * ((alpha[..., 0] - truth[..., 3]) ** 2).mean())
        if recipe.sobel:
            out = out + recipe.sobel * 2 * (functional.conv2d((image - target)[None], filters, padding=1, groups=3) ** 2).mean()
        return out

    return loss
