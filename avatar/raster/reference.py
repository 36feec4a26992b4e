"""The rasteriser's result in plain torch: every gaussian at every pixel. Slow; for tests."""

from __future__ import annotations

import torch

from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import FRUSTUM, MAX_ALPHA, MIN_ALPHA, NEAR, PIXEL, STOP, LowPass


def render(means: torch.Tensor, rotations: torch.Tensor, scales: torch.Tensor, rgb: torch.Tensor, opacity: torch.Tensor,
           camera: Camera, low_pass: LowPass = PIXEL) -> tuple[torch.Tensor, torch.Tensor]:
    """The rgb (H, W, 3) and alpha (H, W) of free gaussians.

    means: (N, 3) m, camera frame; rotations: (N, 3, 3); scales: (N, 3) m; rgb: (N, 3); opacity: (N,) in 0..1.
    """
    front = means[:, 2] > NEAR
    means, rotations, scales, rgb, opacity = (t[front] for t in (means, rotations, scales, rgb, opacity))
    order = torch.argsort(means[:, 2], stable=True)
    means, rotations, scales, rgb, opacity = (t[order] for t in (means, rotations, scales, rgb, opacity))
    z = means[:, 2]
    centre, rows = [], []
    for axis, size in enumerate((camera.width, camera.height)):
        f, c = camera.focal[axis], camera.center[axis]
        ratio = means[:, axis] / z
        centre.append(f * ratio + c)
        margin = 0.5 * FRUSTUM * size / f
        clamped = ratio.clamp(-c / f - margin, (size - c) / f + margin)
        row = [torch.zeros_like(z)] * 3
        row[axis], row[2] = f / z, -f * clamped / z
        rows.append(torch.stack(row, 1))
    jacobian = torch.stack(rows, 1)
    half = jacobian @ rotations * scales[:, None, :]
    bare = half @ half.transpose(1, 2)
    covariance = bare + low_pass.px2 * torch.eye(2, dtype=means.dtype)
    if low_pass.keeps_energy:
        opacity = opacity * torch.sqrt(torch.linalg.det(bare) / torch.linalg.det(covariance))
    inverse = torch.linalg.inv(covariance)

    y, x = torch.meshgrid(torch.arange(camera.height, dtype=means.dtype) + 0.5,
                          torch.arange(camera.width, dtype=means.dtype) + 0.5, indexing="ij")
    offset = torch.stack([x - centre[0][:, None, None], y - centre[1][:, None, None]], -1)
    s = 0.5 * torch.einsum("nhwi,nij,nhwj->nhw", offset, inverse, offset)
    alpha = (opacity[:, None, None] * torch.exp(-s)).clamp(max=MAX_ALPHA)
    alpha = torch.where(alpha >= MIN_ALPHA, alpha, torch.zeros_like(alpha))
    after = torch.cumprod(1 - alpha, 0)
    before = torch.cat([torch.ones_like(after[:1]), after[:-1]])
    weight = torch.where(after > STOP, before * alpha, torch.zeros_like(alpha))
    return torch.einsum("nhw,nc->hwc", weight, rgb), weight.sum(0)
