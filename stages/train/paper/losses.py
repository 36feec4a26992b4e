"""The losses of recipe `paper` in one frame, as HAHA's code has them, or the text of GSAC's paper (`train.paper_text`).

Value and gradient are those of the whole square frame: outside of the box that is rendered, render and frame are the same
background, and beyond the square everything is zero, as in a padded convolution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gsac.avatar import losses
from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians.kernels import on_background, through_background
from gsac.stages.train.task import LPIPS_WEIGHT

SSIM, SOBEL, DICE = 0.1, 1.0, 0.1
"""Weights beside L2."""
TEXT_SOBEL = 16.0
"""Weight in the text's form: `losses.sobel` has a quarter of the operator, and it is squared."""
WINDOW = 256
"""px, side of the window that LPIPS sees."""
GREY = np.array([65.738, 129.057, 25.064], np.float32) / 256
"""Weights of red, green and blue in the grey image."""


@dataclass
class Picture:
    """A rendered box of a square frame, and the frame's pixels there."""

    rgb: np.ndarray
    """(h, w, 3) premultiplied."""
    alpha: np.ndarray
    """(h, w)."""
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""
    background: np.ndarray
    """(3,) float32 in 0..1, behind render and frame."""
    corner: tuple[int, int]
    """x, y of the box in the square, px."""
    side: int
    """Of the square, px."""

    @property
    def mask(self) -> np.ndarray:
        """(h, w) float32 in 0..1."""
        return self.pixels[..., 3] * np.float32(1 / 255)


def picture_loss(picture: Picture, share: float, text: bool, workspace: Workspace, network: FeatureDistance | None = None,
                 centre: np.ndarray | None = None) -> tuple[float, np.ndarray, np.ndarray]:
    """share * the losses of a frame but Dice, and their gradients by the render's rgb (h, w, 3) and alpha (h, w).

    text: as the paper's text has them; network, centre: for LPIPS of a window about centre (2,), px of the square.
    In HAHA's code as GSAC changed it, L2 and SSIM see both images times alpha times mask; no gradient passes through that factor.
    """
    p, gain, grad_gain = picture, np.ones(3, np.float32), np.empty(3)
    image, target, spans = np.empty_like(p.rgb), np.empty_like(p.rgb), np.empty((len(p.rgb), 2), np.int64)
    on_background(workspace.share, p.rgb, p.alpha, p.pixels, p.background, gain, image, target, spans)
    part = share * p.alpha.size / p.side**2  # a mean over the box as its part of the mean over the square
    seen = 1 if text else (p.alpha * p.mask)[..., None]
    value, gradient = losses.l2(image * seen, target * seen, factor=part, workspace=workspace, spans=spans)
    similarity = losses.ssim(image * seen, target * seen, factor=-SSIM * part, gradient=gradient, workspace=workspace,
                             spans=spans).value
    value = part * (value + SSIM * (1 - similarity))
    gradient *= seen
    if text:
        weight = TEXT_SOBEL * SOBEL * part
        value += weight * losses.sobel(image, target, factor=weight, gradient=gradient, workspace=workspace).value
    else:
        value += edge_strength(image, target, p, SOBEL * share / p.side**2, gradient)
    if network is not None and centre is not None:
        value += perceptual(network, image, target, p, centre, LPIPS_WEIGHT * share, gradient)
    grad_rgb, grad_alpha = np.empty_like(image), np.empty_like(p.alpha)
    through_background(workspace.share, gradient, p.rgb, p.alpha, p.pixels, p.background, gain, 0.0, grad_rgb, grad_alpha,
                       grad_gain)
    return float(value), grad_rgb, grad_alpha


def dice(pictures: list[Picture]) -> tuple[float, float]:
    """DICE * (1 - (2 sum p t + 1) / (sum p t + sum t^2 + 1)) over a batch, p = 1 - alpha and t = 1 - mask, and its slope.

    The gradient by alpha is the slope times t.
    """
    both = squares = 0.0
    for p in pictures:
        clear = 1 - p.mask
        outside = p.side**2 - p.alpha.size
        both += float(((1 - p.alpha) * clear).sum(dtype=np.float64)) + outside
        squares += float((clear * clear).sum(dtype=np.float64)) + outside
    either = both + squares + 1
    return DICE * (1 - (2 * both + 1) / either), DICE * (2 * squares + 1) / either**2


def edge_strength(image: np.ndarray, target: np.ndarray, picture: Picture, weight: float, gradient: np.ndarray) -> float:
    """weight * sum of |m(image) - m(target)|, m = sqrt(gx^2 + gy^2 + 1e-6) of the grey image under [-1 0 1].

    image, target, gradient: (h, w, 3). Adds the gradient by the image to `gradient`.
    """
    grey = np.zeros((image.shape[0] + 2, image.shape[1] + 2), np.float32)
    value = _strengths(_surrounded(image, picture), _surrounded(target, picture), np.float32(weight), grey)
    gradient += grey[1:-1, 1:-1, None] * GREY
    return value


def _surrounded(image: np.ndarray, picture: Picture) -> np.ndarray:
    """(h + 2, w + 2): image (h, w, 3) in grey with the pixels around the box: background, zero beyond the square."""
    grey = np.full((image.shape[0] + 2, image.shape[1] + 2), picture.background @ GREY, np.float32)
    grey[1:-1, 1:-1] = image @ GREY
    for axis, (first, size) in enumerate(zip(picture.corner[::-1], image.shape[:2], strict=True)):
        rows = np.moveaxis(grey, axis, 0)
        if first == 0:
            rows[0] = 0
        if first + size == picture.side:
            rows[-1] = 0
    return grey


def perceptual(network: FeatureDistance, image: np.ndarray, target: np.ndarray, picture: Picture, centre: np.ndarray, weight: float,
               gradient: np.ndarray) -> float:
    """weight * LPIPS of a window of the square, WINDOW px or less a side, around `centre` and moved to lie inside the square.

    image, target, gradient: (h, w, 3); centre: (2,) px. Images go to the network in 0..1. Adds the gradient by the image to
    `gradient`.
    """
    size = min(WINDOW, picture.side)
    x, y = (window_begin(c, picture.side) - first for c, first in zip(centre, picture.corner, strict=True))
    low, high = np.maximum([y, x], 0), np.minimum([y + size, x + size], image.shape[:2])
    if (high <= low).any():
        return 0.0
    in_box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    in_window = tuple(slice(a - at, b - at) for a, b, at in zip(low, high, (y, x), strict=True))
    shown = []
    for part in (image, target):
        window = np.empty((size, size, 3), np.float32)
        window[:] = picture.background
        window[in_window] = part[in_box]
        shown.append(window)
    value, slope = network.gradient(*shown, scaled=False)
    gradient[in_box] += np.float32(weight) * slope[in_window]
    return weight * value


def window_begin(centre: float, side: int) -> int:
    """px where HAHA's window about `centre` begins, in a square of `side` px; a smaller one is taken whole."""
    half = min(WINDOW, side) // 2
    return max(min(max(int(centre), half), side - half - 1) - half, 0)


@own_kernel(error_model="numpy", fastmath=True)
def _strengths(image, target, weight, gradient):
    tiny, total = image.dtype.type(1e-6), 0.0
    for y in range(1, image.shape[0] - 1):
        for x in range(1, image.shape[1] - 1):
            gx, gy = image[y, x + 1] - image[y, x - 1], image[y + 1, x] - image[y - 1, x]
            tx, ty = target[y, x + 1] - target[y, x - 1], target[y + 1, x] - target[y - 1, x]
            own = math.sqrt(gx * gx + gy * gy + tiny)
            off = own - math.sqrt(tx * tx + ty * ty + tiny)
            total += abs(off)
            if off == 0:
                continue
            share = weight / own if off > 0 else -weight / own
            gradient[y, x + 1] += share * gx
            gradient[y, x - 1] -= share * gx
            gradient[y + 1, x] += share * gy
            gradient[y - 1, x] -= share * gy
    return weight * total
