"""Comparisons: kernels with their plain reference, and a step of recipe `paper` with the same step by the published definition."""

from __future__ import annotations

import numpy as np
import torch

from gsac.benchmarks.gpu.published import formulas, splats
from gsac.benchmarks.gpu.published.body import FIGURE
from gsac.benchmarks.gpu.published.scene import Scene, task_of
from gsac.benchmarks.gpu.published.tiles import Sheet
from gsac.benchmarks.gpu.published.trainer import Trainer, gradient_of

FRAMES, WIDTH, HEIGHT, FOCAL, OPACITY = 2, 44, 37, 60.0, 0.9
"""Of made-up splats: px."""
SHOWN = "image", "alpha", "places", "quaternions", "scales", "colours", "shifts"
"""What a drawing gives, and what it is differentiated by."""
COUNTED = 150
"""A step whose gradients are summed."""


def made_splats(count: int = 60) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """`SHOWN` from places on, of gaussians before a camera; background (B, 3), and gradients of image and alpha."""
    torch.manual_seed(0)
    parts = [torch.randn(FRAMES, count, 3) * torch.tensor([0.25, 0.25, 0.1]) + torch.tensor([0, 0, 2.0]),
             torch.nn.functional.normalize(torch.randn(FRAMES, count, 4), dim=-1), torch.rand(FRAMES, count, 3) * 0.08 + 0.01,
             torch.rand(count, 3), torch.zeros(FRAMES, count, 2)]
    return parts, [torch.rand(FRAMES, 3), torch.randn(FRAMES, HEIGHT, WIDTH, 3), torch.randn(FRAMES, HEIGHT, WIDTH)]


def drawn_with_gradients(parts: list[torch.Tensor], background: torch.Tensor, by_image: torch.Tensor, by_alpha: torch.Tensor,
                         exact: bool) -> list[torch.Tensor]:
    """`SHOWN`: image (B, h, w, 3) and alpha (B, h, w), and the gradients of made splats, of the parts' shapes.

    parts: places and others of `made_splats`, (B, N, 3) first; background: (B, 3); by_image: (B, h, w, 3); by_alpha: (B, h, w),
    weights of the pixels in what is differentiated.
    """
    places, quats, scales, rgb, shift = leaves = [part.clone().requires_grad_() for part in parts]
    lens = background.new_tensor([[FOCAL, FOCAL], [WIDTH / 2, HEIGHT / 2]]).expand(FRAMES, 2, 2)
    sheet = Sheet(WIDTH, HEIGHT, background, OPACITY, exact)
    drawn = splats.draw(places, quats, scales, rgb, shift, lens[:, 0], lens[:, 1], sheet)
    ((drawn.image * by_image).sum() + (drawn.alpha * by_alpha).sum()).backward()
    return [drawn.image.detach(), drawn.alpha.detach(), *map(gradient_of, leaves)]


def compare_kernels(exact: bool) -> dict[str, float]:
    """Name of what a drawing gives -> how far the GPU's is from the plain reference's, as a share of the norm."""
    from gsac.benchmarks.gpu.published import kernels

    parts, others = made_splats()
    expected = drawn_with_gradients(parts, *others, exact=exact)
    found = drawn_with_gradients([part.cuda() for part in parts], *(other.cuda() for other in others), exact=exact)
    apart = {name: apart_of(a.cpu(), b) for name, a, b in zip(SHOWN, found, expected, strict=True)}
    places = torch.randn(1000, 3)
    near = kernels.nearest(places.cuda()).cpu().sort(1).values
    return apart | {"neighbours that differ": float((near != formulas.nearest(places).sort(1).values).float().mean())}


def compare_step(scene: Scene, exact: bool) -> dict[str, float]:
    """Name -> how far recipe `paper` on the CPU is from the published definition in a first step, as a share of the latter's norm.

    exact: of `trainer.Trainer`.
    """
    from gsac.stages.train.paper import trainer as paper

    task = task_of(scene)
    batches, views, poses = paper.plan_batches(task), paper.crop_views(task), task.poses
    frames = batches.order[0].tolist()
    assert np.array_equal(batches.order, scene.order) and formulas.counts(COUNTED)
    theirs = Trainer(scene, "cpu", True, exact)
    vertices = theirs.body.vertices(frames).detach().numpy()
    apart = {"vertices, m": float(np.abs(vertices - [poses.vertices(t) for t in frames]).max())}
    value, shift, radius = theirs.loss(0)
    value.backward()

    mine = paper.Trainer(task, np.random.default_rng(task.config.seed))
    loss = mine.step({t: views[t] for t in frames}, COUNTED, 3000, batches.background[0], batches.centre[0])
    apart["loss"] = abs(loss / value.item() - 1)
    pose = mine.body.pose[0, frames]
    gradients = {name: (moments, gradient_of(theirs.values[name])) for name, moments in mine.first.items()} | {
        "orientation and body pose": (pose[:, FIGURE], grads_of(theirs.body.figure, frames)),
        "translation": (pose[:, -1], grads_of(theirs.body.transl, frames)),
        "betas": (mine.body.betas[0], gradient_of(theirs.body.betas))}
    for name, (first, gradient) in gradients.items():
        apart[name] = apart_of(10 * first, gradient)  # from empty moments a step leaves a tenth of the gradient

    total, times = torch.zeros(2, len(mine.face), dtype=torch.float64)
    formulas.note(total, times, gradient_of(shift), radius)
    ours, published = (length / np.maximum(hits, 1) for length, hits in
                       ((mine.densifier.length, mine.densifier.hits), (total.numpy(), times.numpy())))
    apart["lengths in the image"] = apart_of(ours, published)
    apart["their mean over the published, less one"] = ours.sum() / published.sum() - 1
    apart["share seen in another number of frames"] = float((times.numpy() != mine.densifier.hits).mean())
    (mine_largest, their_largest) = (set(np.argsort(-lengths)[:len(lengths) // 100]) for lengths in (ours, published))
    apart["share of the largest hundredth that is another"] = 1 - len(mine_largest & their_largest) / len(their_largest)
    return apart


def grads_of(parameters: torch.nn.ParameterList, frames: list[int]) -> torch.Tensor:
    """(B, ...) gradients of the frames' parameters."""
    return torch.stack([gradient_of(parameters[t]) for t in frames])


def apart_of(found: np.ndarray | torch.Tensor, expected: np.ndarray | torch.Tensor) -> float:
    """Norm of the difference over that of `expected`. found, expected: (...)."""
    return float(np.linalg.norm(np.asarray(found) - np.asarray(expected)) / np.linalg.norm(np.asarray(expected)))
