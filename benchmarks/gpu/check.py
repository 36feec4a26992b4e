"""Compares a step of the CUDA trainer with the same step of the CPU path: image, loss and every gradient."""

from __future__ import annotations

import numpy as np

from gsac.avatar import losses
from gsac.avatar.cuda.arrays import Shot
from gsac.avatar.cuda.device import Device
from gsac.avatar.cuda.recipe import Recipe
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound, render_bound_backward
from gsac.avatar.skinning import skin_backward
from gsac.benchmarks.gpu.synthetic_clip import Figure

NAMES = ("image", "loss", "mu", "quat", "log_scale", "rgb", "logit", "pose", "transl")
PER_GAUSSIAN = ("mu", "quat", "log_scale", "rgb", "logit")
LIMIT = 1e-3
"""Largest relative error allowed."""
SWAPS = 1e-3
"""Share of the gaussians left out because float32 may swap their order with one at nearly the same depth, which swaps gradients.

The CPU's own float32 differs from its float64 in the same way (25,000 gaussians: 3 pairs, 5e-3 of the colours' norm).
"""


def relative(got: np.ndarray, expected: np.ndarray, leave: int = 0) -> float:
    """Relative error: norm of the difference over the norm of `expected`, or over 1 if that is 0.

    got, expected: (n, ...) or scalar; leave: number of rows with the largest difference to leave out.
    """
    got, expected = np.asarray(got, np.float64), np.asarray(expected, np.float64)
    size = np.linalg.norm(expected)
    rows = np.sort(np.linalg.norm((got - expected).reshape(len(got), -1) if got.ndim else (got - expected)[None, None], axis=1))
    return float(np.linalg.norm(rows[: len(rows) - leave]) / (size if size > 0 else 1))


def cpu_step(figure: Figure, shot: Shot, t: int, gaussians: Gaussians, background: np.ndarray, recipe: Recipe) -> dict:
    """Image (H, W, 4), loss and gradients of frame t on the CPU, by `NAMES`. background: (3,)."""
    body = figure.body
    rendering = render_bound(figure.vertices(figure.pose[t], figure.transl[t]), body.faces, gaussians, shot.camera)
    pixels = shot.pixels.astype(np.float32) / np.float32(255)
    clear = 1 - rendering.alpha[..., None]
    image = rendering.rgb + clear * background
    target = pixels[..., :3] + (1 - pixels[..., 3:]) * background
    loss, gradient = losses.l2(image, target)
    if recipe.ssim:
        loss += recipe.ssim * (1 - losses.ssim(image, target, factor=-recipe.ssim, gradient=gradient).value)
    if recipe.sobel:
        loss += recipe.sobel * losses.sobel(image, target, factor=recipe.sobel, gradient=gradient).value
    difference = rendering.alpha - pixels[..., 3]
    loss += recipe.mask * float((difference**2).mean())
    grad_alpha = 2 * recipe.mask / difference.size * difference - (gradient * background).sum(2)
    grads = render_bound_backward(rendering.state, gradient, grad_alpha.astype(np.float32))
    pose, transl, _, _ = skin_backward(grads.vertices, figure.pose[t], body.rest[0], body.joints, body.parents,
                                       body.skin_index, body.skin_weight)
    logit = grads.opacity * gaussians.opacity * (1 - gaussians.opacity)
    return {"image": np.dstack([rendering.rgb, rendering.alpha]), "loss": loss, "mu": grads.mu, "quat": grads.quat,
            "log_scale": grads.log_scale, "rgb": grads.rgb, "logit": logit, "pose": pose, "transl": transl}


def cuda_step(trainer: CudaTrainer) -> dict:
    """The same of a trainer's next step, for its batch's first frame; scratch memory is filled with NaN before."""
    trainer.want_gradients()
    trainer.poison()
    before = trainer.state().step
    trainer.train(1)
    if trainer.state().step != before + 1:
        raise RuntimeError("the step was not carried out")
    frame = trainer.buffers
    h, w = trainer.shot_size(before)
    rows, columns = -(-h // 16), -(-w // 16)
    image = frame["image"].read()[: h * w].reshape(h, w, 4)
    reached = np.repeat(np.repeat(frame["tile_count"].read()[: rows * columns].reshape(rows, columns) > 0, 16, 0), 16, 1)[:h, :w]
    grads, pose = frame["grad_out"].read(), frame["pose_grad_out"].read()[0]
    parts = dict(zip(("mu", "quat", "log_scale", "rgb", "logit"), np.split(grads, (3, 7, 10, 13), 1), strict=True))
    parts["logit"] = parts["logit"][:, 0]
    return parts | {"image": np.where(reached[..., None], image, 0), "loss": trainer.losses()[before, 0], "pose": pose[:-1],
                    "transl": pose[-1]}


def errors(figure: Figure, gaussians: Gaussians, recipe: Recipe, device: Device | None = None,
           pair_room: int | None = None) -> tuple[dict[str, float], dict[str, float]]:
    """Relative error of each of `NAMES` at the first step: without the share `SWAPS` of the gaussians, and with all."""
    trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, gaussians, recipe, device, pair_room)
    try:
        shown = trainer.gaussians()
        got = cuda_step(trainer)
        t, background = int(trainer.order[0, 0]), trainer.buffers["background"].read()[0, 0]
    finally:
        trainer.close()
    expected = cpu_step(figure, figure.shots[t], t, shown, background, recipe)
    leave = {name: int(SWAPS * len(gaussians)) for name in PER_GAUSSIAN}
    return ({name: relative(got[name], expected[name], leave.get(name, 0)) for name in NAMES},
            {name: relative(got[name], expected[name]) for name in NAMES})
