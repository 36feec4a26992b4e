"""Losses that only recipe `paper` has: edge strength in grey, Dice of the background, LPIPS of a window."""

from __future__ import annotations

import math

import numpy as np

from gsac.avatar.lpips import Lpips
from gsac.avatar.numba_kernel import own_kernel

WINDOW = 256
"""px, side of the window that LPIPS sees."""
GREY = np.array([0.299, 0.587, 0.114], np.float32)


def sobel_magnitude(image: np.ndarray, target: np.ndarray, weight: float, gradient: np.ndarray) -> float:
    """weight * sum of |m(image) - m(target)|, m = sqrt(gx^2 + gy^2 + 1e-6) of the grey image under [-1 0 1].

    image, target, gradient: (h, w, 3). Adds the gradient by the image to `gradient`; the outermost pixels carry no m.
    """
    grey = np.zeros(image.shape[:2], np.float32)
    loss = _magnitude(image @ GREY, target @ GREY, np.float32(weight), grey)
    gradient += grey[..., None] * GREY
    return loss


def dice(alpha: np.ndarray, pixels: np.ndarray, outside: int, weight: float, grad_alpha: np.ndarray) -> float:
    """weight * (1 - 2 sum(p t) / (sum p + sum t)) of p = 1 - alpha, t = 1 - mask, over the box and `outside` pixels more.

    alpha, grad_alpha: (h, w); pixels: (h, w, 4) uint8. Adds the gradient by alpha to grad_alpha.
    """
    p, t = 1 - alpha, 1 - pixels[..., 3] * np.float32(1 / 255)
    both = float((p * t).sum(dtype=np.float64)) + outside
    either = float(p.sum(dtype=np.float64) + t.sum(dtype=np.float64)) + 2 * outside
    either = max(either, 1e-9)
    grad_alpha += np.float32(2 * weight / either) * t - np.float32(2 * weight * both / either**2)
    return weight * (1 - 2 * both / either)


def perceptual(network: Lpips, image: np.ndarray, target: np.ndarray, background: np.ndarray, corner: np.ndarray,
               frame: tuple[int, int], centre: np.ndarray, weight: float, gradient: np.ndarray) -> float:
    """weight * LPIPS of a window of the frame, WINDOW px or less a side, around `centre` and shifted to lie inside the frame.

    image, target, gradient: (h, w, 3) of a box at corner (2,) x, y px of the frame (width, height px), which is background (3,)
    outside of the box; centre: (2,) px. Images go to the network in 0..1. Adds the gradient by the image to `gradient`.
    """
    size = np.minimum(WINDOW, frame)
    x, y = np.floor(np.clip(centre - size / 2, 0, np.asarray(frame) - size)).astype(int) - corner
    low, high = np.maximum([y, x], 0), np.minimum([y + size[1], x + size[0]], image.shape[:2])
    if (high <= low).any():
        return 0.0
    in_box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    in_window = tuple(slice(a - at, b - at) for a, b, at in zip(low, high, (y, x), strict=True))
    shown = []
    for part in (image, target):
        window = np.empty((size[1], size[0], 3), np.float32)
        window[:] = background
        window[in_window] = part[in_box]
        shown.append(window)
    value, slope = network.gradient(*shown, scaled=False)
    gradient[in_box] += np.float32(weight) * slope[in_window]
    return weight * value


@own_kernel(error_model="numpy", fastmath=True)
def _magnitude(image, target, weight, gradient):
    tiny, loss = image.dtype.type(1e-6), 0.0
    for y in range(1, image.shape[0] - 1):
        for x in range(1, image.shape[1] - 1):
            gx, gy = image[y, x + 1] - image[y, x - 1], image[y + 1, x] - image[y - 1, x]
            tx, ty = target[y, x + 1] - target[y, x - 1], target[y + 1, x] - target[y - 1, x]
            own = math.sqrt(gx * gx + gy * gy + tiny)
            off = own - math.sqrt(tx * tx + ty * ty + tiny)
            loss += abs(off)
            if off == 0:
                continue
            share = weight / own if off > 0 else -weight / own
            gradient[y, x + 1] += share * gx
            gradient[y, x - 1] -= share * gx
            gradient[y + 1, x] += share * gy
            gradient[y - 1, x] -= share * gy
    return weight * loss
