"""Fused losses against their definition in torch."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.nn import functional

from gsac.avatar import losses


def mean(map_, weights):
    """map_: (3, H, W)."""
    return (map_.mean(0) * weights).sum() / weights.sum()


def torch_l2(image, target, weights):
    return mean(((image - target) ** 2).permute(2, 0, 1), weights)


def torch_ssim(image, target, weights):
    line = torch.exp(-(torch.arange(-5, 6, dtype=image.dtype) ** 2) / (2 * 1.5**2))
    line = line / line.sum()
    window = (line[:, None] * line).expand(3, 1, 11, 11)
    x, y = image.permute(2, 0, 1), target.permute(2, 0, 1)

    def blur(t):
        return functional.conv2d(t[None], window, padding=5, groups=3)[0]

    mx, my = blur(x), blur(y)
    xx, yy, xy = blur(x * x) - mx**2, blur(y * y) - my**2, blur(x * y) - mx * my
    return mean((2 * mx * my + 1e-4) * (2 * xy + 9e-4) / ((mx**2 + my**2 + 1e-4) * (xx + yy + 9e-4)), weights)


def torch_sobel(image, target, weights):
    across = torch.tensor([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], dtype=image.dtype) / 4
    kernels = torch.stack([across, across.T])[:, None]
    response = functional.conv2d((image - target).permute(2, 0, 1)[:, None], kernels, padding=1)
    return mean((response**2).sum(1), weights)


DEFINITIONS = {"l2": torch_l2, "ssim": torch_ssim, "sobel": torch_sobel}


def images(height, width, seed=0):
    random = np.random.default_rng(seed)
    target = random.random((height, width, 3))
    target[: height // 2] = 0.7  # flat parts are where SSIM divides by little
    image = np.clip(target + 0.1 * random.normal(size=target.shape), 0, 1)
    return image, target, random.random((height, width))


@pytest.mark.parametrize("name", DEFINITIONS)
@pytest.mark.parametrize("box", [None, (7, 40, 11, 39), (0, 53, 2, 47), (5, 7, 40, 47)])
@pytest.mark.parametrize("weighted", [False, True])
# float32: torch itself is 1.5e-4 from float64 here, where windows are flat
@pytest.mark.parametrize(("real", "value_bound", "gradient_bound"), [(np.float64, 1e-12, 1e-12), (np.float32, 1e-6, 1e-4)])
def test_value_and_gradient_agree_with_torch(name, box, weighted, real, value_bound, gradient_bound):
    image, target, weights = images(53, 47)
    top, bottom, left, right = box or (0, 53, 0, 47)
    x = torch.tensor(image, requires_grad=True)
    part = (slice(top, bottom), slice(left, right))
    wanted = DEFINITIONS[name](x[part], torch.tensor(target)[part], torch.tensor(weights if weighted else np.ones((53, 47)))[part])
    (-0.3 * wanted).backward()
    got = getattr(losses, name)(image.astype(real), target.astype(real), box, weights if weighted else None, factor=-0.3)
    assert abs(got.value - wanted.item()) < value_bound
    assert np.abs(got.gradient - x.grad.numpy()).max() < gradient_bound * x.grad.abs().max().item()
    outside = np.ones((53, 47), bool)
    outside[part] = False
    assert not got.gradient[outside].any()


def test_ssim_of_a_wide_image_agrees_with_torch():
    image, target, _ = images(17, 181, 1)
    x = torch.tensor(image, requires_grad=True)
    wanted = torch_ssim(x, torch.tensor(target), torch.ones(17, 181, dtype=torch.float64))
    wanted.backward()
    got = losses.ssim(image, target)
    assert abs(got.value - wanted.item()) < 1e-12
    assert np.abs(got.gradient - x.grad.numpy()).max() < 1e-12 * x.grad.abs().max().item()


@pytest.mark.parametrize("weighted", [False, True])
def test_columns_that_are_said_to_be_the_same_change_neither_loss_nor_gradient_of_the_others(weighted):
    image, target, weights = images(90, 150)
    rng, spans = np.random.default_rng(5), np.zeros((90, 2), np.int64)
    spans[30:50, 0] = rng.integers(60, 80, 20)
    spans[30:50, 1] = spans[30:50, 0] + rng.integers(0, 40, 20)
    columns = np.arange(150)
    same = (columns < spans[:, :1]) | (columns >= spans[:, 1:])
    target[same] = image[same]
    for loss in (losses.l2, losses.ssim):
        every = loss(image, target, weights=weights if weighted else None)
        some = loss(image, target, weights=weights if weighted else None, spans=spans)
        assert abs(some.value - every.value) < 1e-12
        assert np.abs(some.gradient - every.gradient)[~same].max() < 1e-12 * np.abs(every.gradient).max()


def test_gradients_of_several_losses_add_up_in_one_array():
    image, target, _ = (a.astype(np.float32) for a in images(20, 30))
    apart = losses.l2(image, target).gradient + losses.ssim(image, target, factor=-0.1).gradient
    together = np.zeros_like(image)
    losses.l2(image, target, gradient=together)
    losses.ssim(image, target, factor=-0.1, gradient=together)
    assert np.allclose(apart, together, atol=1e-9)


def test_equal_images_have_no_loss():
    image = images(16, 16)[0].astype(np.float32)
    assert losses.l2(image, image).value == 0 and losses.sobel(image, image).value == 0
    same = losses.ssim(image, image)
    assert abs(same.value - 1) < 1e-6 and np.abs(same.gradient).max() < 1e-6


def test_no_weight_anywhere_is_no_loss_and_no_nan():
    image, target, weights = images(16, 16)
    for loss in (losses.l2, losses.ssim, losses.sobel):
        got = loss(image, target, weights=0 * weights)
        assert got.value == 0 and not got.gradient.any()


@pytest.mark.parametrize("box", [(0, 0, 0, 5), (0, 17, 0, 5), (-1, 5, 0, 5), (4, 3, 0, 5)])
def test_a_box_outside_the_image_is_refused_by_name(box):
    image = images(16, 16)[0]
    with pytest.raises(ValueError, match="box"):
        losses.ssim(image, image, box)


def test_images_of_different_size_are_refused():
    with pytest.raises(ValueError, match="16"):
        losses.l2(np.zeros((16, 16, 3)), np.zeros((16, 17, 3)))
