"""The same loop in torch and gsplat: skinning, binding, gsplat's rasteriser, L2 + SSIM + Sobel + mask, Adam with learned poses."""

from __future__ import annotations

import numpy as np
import torch
from gsac.avatar.cuda.lists import joint_levels
from gsac.avatar.cuda.recipe import Recipe
from gsac.avatar.gaussians import Gaussians
from gsac.benchmarks.gpu.figure import Figure
from torch.nn import functional


def seconds_per_step(figure: Figure, gaussians: Gaussians, recipe: Recipe, compiled: bool, steps: int = 60,
                     warm: int = 20) -> float:
    """One frame a step, by device events; compiled: skinning + binding and the losses through torch.compile."""
    from gsplat import rasterization

    body = figure.body
    device = torch.device("cuda")

    def tensor(array, dtype=torch.float32):
        return torch.as_tensor(np.ascontiguousarray(array), dtype=dtype, device=device)

    rest, joints = tensor(body.rest[0]), tensor(body.joints)
    parents = np.asarray(body.parents)
    levels = joint_levels(parents)
    skin_index, skin_weight = tensor(body.skin_index, torch.long), tensor(body.skin_weight)
    corner = tensor(np.asarray(body.faces)[gaussians.face], torch.long)
    pixels = torch.stack([tensor(shot.pixels, torch.uint8) for shot in figure.shots])
    camera = figure.shots[0].camera
    lens = tensor([[camera.focal[0], 0, camera.center[0]], [0, camera.focal[1], camera.center[1]], [0, 0, 1]])[None]
    eye = torch.eye(4, device=device)[None]
    window = torch.exp(-torch.arange(-5, 6, device=device) ** 2 / (2 * 1.5**2))
    window = window / window.sum()
    sobel = tensor(np.outer([1, 2, 1], [-1, 0, 1]) / 4)
    filters = torch.stack([sobel, sobel.T])[:, None].repeat(3, 1, 1, 1)
    by_level = [tensor(np.flatnonzero(levels == k), torch.long) for k in range(levels.max() + 1)]
    above = [tensor(parents[np.flatnonzero(levels == k)], torch.long) for k in range(levels.max() + 1)]

    def geometry(pose, transl, mu, quat, log_scale):
        t = pose.norm(dim=1).clamp(min=1e-8)[:, None, None]
        x, y, z = (pose / t[:, 0]).unbind(1)
        zero = torch.zeros_like(x)
        k = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], 1).reshape(-1, 3, 3)
        local = torch.eye(3, device=device) + t.sin() * k + (1 - t.cos()) * k @ k
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
        return means, half @ half.transpose(1, 2)

    def blur(images):
        flat = images.reshape(-1, 1, *images.shape[-2:])
        flat = functional.conv2d(flat, window.view(1, 1, 1, 11), padding=(0, 5))
        flat = functional.conv2d(flat, window.view(1, 1, 11, 1), padding=(5, 0))
        return flat.reshape(images.shape)

    def loss_of(rgb, alpha, shot, background):
        truth = shot.float() / 255
        image = (rgb + (1 - alpha) * background).permute(2, 0, 1)
        target = (truth[..., :3] + (1 - truth[..., 3:]) * background).permute(2, 0, 1)
        mx, my, q, p = blur(torch.stack([image, target, image**2 + target**2, image * target]))
        squares, product = mx * mx + my * my, mx * my
        similarity = (2 * product + 1e-4) * (2 * (p - product) + 9e-4) / ((squares + 1e-4) * (q - squares + 9e-4))
        edges = functional.conv2d((image - target)[None], filters, padding=1, groups=3)
        return (functional.mse_loss(image, target) + recipe.ssim * (1 - similarity.mean()) + recipe.sobel * 2 * (edges**2).mean()
                + recipe.mask * ((alpha[..., 0] - truth[..., 3]) ** 2).mean())

    if compiled:
        geometry, loss_of = torch.compile(geometry), torch.compile(loss_of)
    logit = np.log(gaussians.opacity / (1 - gaussians.opacity))
    values = [tensor(a).requires_grad_() for a in (gaussians.mu, gaussians.quat, gaussians.log_scale, gaussians.rgb, logit)]
    poses, transls = tensor(figure.pose).requires_grad_(), tensor(figure.transl).requires_grad_()
    rates = (recipe.mu_rate, recipe.quat_rate, recipe.scale_rate, recipe.rgb_rate, recipe.opacity_rate)
    groups = [{"params": [v], "lr": rate} for v, rate in zip(values, rates, strict=True)]
    optimiser = torch.optim.Adam([*groups, {"params": [poses, transls], "lr": recipe.pose_rate}], betas=(0.9, 0.99), fused=True)
    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    for step in range(warm + steps):
        if step == warm:
            torch.cuda.synchronize()
            begin.record()
        t = step % len(figure.shots)
        mu, quat, log_scale, rgb, opacity = values
        means, covars = geometry(poses[t], transls[t], mu, quat, log_scale)
        drawn, alpha, _ = rasterization(means, None, None, opacity.sigmoid(), rgb, eye, lens, camera.width, camera.height,
                                        packed=False, covars=covars)
        loss = loss_of(drawn[0], alpha[0], pixels[t], torch.rand(3, device=device))
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
    end.record()
    torch.cuda.synchronize()
    if not torch.isfinite(loss):
        raise RuntimeError("the baseline's loss is not finite")
    return begin.elapsed_time(end) / steps / 1e3
