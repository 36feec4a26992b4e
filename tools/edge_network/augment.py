"""Makes of rendered patches what other cameras, rooms and clothes could have shown; truth and picture change alike."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

SIDE = 160
"""px of a patch that is trained on."""
KERNEL = 4
"""px, half width of a blur."""


def augment(patches: Tensor) -> Tensor:
    """patches: (N, 192, 192, 10) uint8 of `patches.py`. Returns (N, 10, 160, 160) in 0..1, changed at random."""
    x = _place(patches.permute(0, 3, 1, 2).float() / 255)
    image, scene, known = x[:, :3], x[:, 3:6], x[:, 6:7] > 0.99
    outline, probability, truth = (x[:, 7:8] > 0.5).float(), x[:, 8:9], x[:, 9:10]
    image = _towards_scene(image, truth)
    image, scene = _in_other_room(image, scene, truth)
    image, scene, truth = _through_lens(image, scene, truth)
    image, scene = _in_other_light(image, scene)
    image, scene = _with_noise(image, scene)
    known = known & _without_holes(image)
    x = torch.cat([image, scene * known, known.float(), outline, probability, truth], 1)
    return torch.nan_to_num(x, nan=0.5, posinf=1.0, neginf=0.0).clamp(0, 1)


def _place(x: Tensor) -> Tensor:
    """Scaled by up to 1.4 or as they are, moved, mirrored."""
    n = len(x)
    scale = torch.where(_chance(n, 0.4, x), SIDE / x.shape[-1], _uniform(n, 0.6, 1.0, x)).view(n)
    mirror = torch.where(_chance(n, 0.5, x), 1.0, -1.0).view(n)
    matrix = torch.zeros(n, 2, 3, device=x.device)
    matrix[:, 0, 0], matrix[:, 1, 1] = scale * mirror, scale
    matrix[:, :, 2] = (torch.rand(n, 2, device=x.device) * 2 - 1) * (1 - scale)[:, None]
    grid = functional.affine_grid(matrix, [n, x.shape[1], SIDE, SIDE], align_corners=False)
    return functional.grid_sample(x, grid, mode="bilinear", padding_mode="border", align_corners=False)


def _towards_scene(image: Tensor, truth: Tensor) -> Tensor:
    """The person's mean colour moved to that of the scene, by up to nine tenths, in three patches of ten."""
    share = _uniform(len(image), 0, 0.9, image) * _chance(len(image), 0.3, image)
    behind, in_front = (_mean(image, weight + 1e-3) for weight in (1 - truth, truth))
    return image + truth * share * (behind - in_front)


def _in_other_room(image: Tensor, scene: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """The person before another patch's scene, or a painted one, in every fourth patch; what differed from the plate still does."""
    n, side = len(image), image.shape[-1]
    painted = sum(0.25 * _smooth(n, cells, side, image) for cells in (3, 8, 24)) + _uniform(n, 0, 0.3, image)
    other = torch.where(_chance(n, 0.5, image), scene[torch.randperm(n, device=image.device)], painted)
    differed = ((image - scene) * (truth < 0.01)).clamp(-0.15, 0.05)
    solid, wide = (truth > 0.98).float(), torch.full((n,), 1.5, device=image.device)
    share = _blur(solid, wide)
    own = torch.where((solid > 0) | (share < 0.02), image, _blur(image * solid, wide) / share.clamp_min(1e-3))
    moved = _chance(n, 0.25, image)
    return (torch.where(moved, truth * own + (1 - truth) * (other + differed), image), torch.where(moved, other, scene))


def _through_lens(image: Tensor, scene: Tensor, truth: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Out of focus by .3 to 1.4 px, in every second patch: a pixel's alpha then is its neighbours', too."""
    n = len(image)
    sigma = (_uniform(n, 0.3, 1.4, image) * _chance(n, 0.5, image)).view(n)
    blurred = _blur(torch.cat([image, scene, truth], 1), sigma)
    return blurred[:, :3], blurred[:, 3:6], blurred[:, 6:7]


def _in_other_light(image: Tensor, scene: Tensor) -> tuple[Tensor, Tensor]:
    """Gamma, contrast and gain of each colour."""
    n = len(image)
    gain = torch.rand(n, 3, 1, 1, device=image.device) * 0.3 + 0.85
    gamma, contrast = torch.exp(_uniform(n, -0.3, 0.3, image)), _uniform(n, 0.5, 1.25, image)
    middle = image.mean((1, 2, 3), keepdim=True).clamp(0.01, 1) ** gamma

    def lit(x: Tensor) -> Tensor:
        return (((x.clamp(0, 1) ** gamma - middle) * contrast + middle) * gain).clamp(0, 1)

    return lit(image), lit(scene)


def _with_noise(image: Tensor, scene: Tensor) -> tuple[Tensor, Tensor]:
    """Noise of sensor and of coding; a plate of slightly other exposure, in some patches a pixel off; both in bytes again."""
    n, coarse = len(image), torch.full((len(image),), 1.2, device=image.device)
    image = image + torch.randn_like(image) * _uniform(n, 0, 3 / 255, image)
    image = image + _blur(torch.randn_like(image), coarse) * _uniform(n, 0, 6 / 255, image)
    scene = scene * (1 + (torch.rand(n, 3, 1, 1, device=image.device) - 0.5) * 0.02)
    scene = scene + torch.randn_like(scene) * _uniform(n, 0, 1 / 255, image)
    scene = torch.where(_chance(n, 0.15, image), torch.roll(scene, (1, 0), (2, 3)), scene)
    return (image.clamp(0, 1) * 255).round() / 255, (scene.clamp(0, 1) * 255).round() / 255


def _without_holes(image: Tensor) -> Tensor:
    """(N, 1, H, W) bool, where the plate stays known: a fifth have none, a fifth of the others lack a rectangle."""
    n, side = len(image), image.shape[-1]
    y, x = (torch.arange(side, device=image.device).view(shape) for shape in ((1, 1, -1, 1), (1, 1, 1, -1)))
    inside = [(place - _uniform(n, 0, side, image)).abs() < _uniform(n, 4, 40, image) for place in (y, x)]
    return ~(inside[0] & inside[1] & _chance(n, 0.2, image)) & ~_chance(n, 0.2, image)


def _blur(x: Tensor, sigma: Tensor) -> Tensor:
    """x: (N, C, H, W); sigma: (N,) px, 0 for none."""
    n, c, h, w = x.shape
    place = torch.arange(-KERNEL, KERNEL + 1, device=x.device, dtype=x.dtype)
    kernel = torch.exp(-place**2 / (2 * sigma[:, None].clamp_min(0.05) ** 2))
    kernel = (kernel / kernel.sum(1, keepdim=True)).repeat_interleave(c, 0)[:, None]
    padded = functional.pad(x.reshape(1, n * c, h, w), (KERNEL,) * 4, mode="replicate")
    down = functional.conv2d(padded, kernel[..., None], groups=n * c)
    return functional.conv2d(down, kernel[:, :, None], groups=n * c).reshape(n, c, h, w)


def _smooth(n: int, cells: int, side: int, like: Tensor) -> Tensor:
    """(n, 3, side, side) in 0..1, random colours that change smoothly from cell to cell."""
    field = torch.rand(n, 3, cells, cells, device=like.device)
    return functional.interpolate(field, size=(side, side), mode="bicubic", align_corners=False).clamp(0, 1)


def _mean(x: Tensor, weight: Tensor) -> Tensor:
    """(N, C, 1, 1), of x (N, C, H, W) by weight (N, 1, H, W)."""
    return (x * weight).sum((2, 3), keepdim=True) / weight.sum((2, 3), keepdim=True)


def _uniform(n: int, low: float, high: float, like: Tensor) -> Tensor:
    """(n, 1, 1, 1), one number a patch."""
    return torch.rand(n, 1, 1, 1, device=like.device) * (high - low) + low


def _chance(n: int, share: float, like: Tensor) -> Tensor:
    """(n, 1, 1, 1) bool, one a patch."""
    return torch.rand(n, 1, 1, 1, device=like.device) < share
