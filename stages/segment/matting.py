"""The soft edge: alpha near the outline, from the colours on both sides of it and their course from pixel to pixel."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.stages.segment.matting_kernels import matting_rows, solve_rows
from gsac.stages.segment.plate import Plate

BAND = 4
"""Pixels on each side of the outline whose alpha is computed."""
NEAR = 1
"""Those of them whose own colour says how much of each side is in it; the others begin as the outline has them."""
REACH = 5
"""Half width, px, of the window in which the colours of both sides are averaged."""
CONTRAST = 0.1
"""Distance of both colours (RGB, 0..1) at which alpha is half theirs, half the smoothed outline's; less distance, more outline."""
NOISE = 3e-5
"""Variance of a colour (0..1) within one surface."""
HOLD = 0.1
"""Weight of a pixel's first alpha beside the matting Laplacian, whose diagonal is about 8."""
STEPS = 15
"""Of the solver, after which the error of alpha no longer falls."""
HAZE = 0.1
"""Alpha that counts as none, and below 1 as whole: a smooth solution leaves so much of each side beyond the edge."""


def soften(image: np.ndarray, outline: np.ndarray, plate: Plate | None = None) -> np.ndarray:
    """image: (H, W, 3) uint8; outline: (H, W) 0..1; plate: the empty scene in the frame's exposure.

    Returns (H, W) float32 alpha: 1 inside, 0 outside, in the band closed-form matting (Levin et al. 2008) that begins at, and is
    held to, `share_of_colours`.
    """
    alpha = share_of_colours(image, outline, plate)
    hard, around = (outline > 0.5).astype(np.uint8), _square(BAND)
    unknown = (cv2.erode(hard, around) == 0) & (cv2.dilate(hard, around) > 0)
    rows, columns = np.nonzero(unknown)
    if len(rows) == 0 or min(outline.shape) < 3:
        return alpha
    order = np.full(outline.shape, -1, np.int32)
    order[rows, columns] = np.arange(len(rows))
    windows = np.zeros(outline.shape, np.uint8)
    windows[1:-1, 1:-1] = cv2.dilate(unknown.astype(np.uint8), _square(1))[1:-1, 1:-1]
    laplacian, pulls = matting_rows(image, order, alpha, np.argwhere(windows), NOISE)
    first, width = alpha[rows, columns], outline.shape[1] + 4
    laplacian[:, 2, 2] += HOLD
    solved = solve_rows(laplacian, (rows + 2) * width + columns + 2, width, pulls + np.float32(HOLD) * first, first, STEPS)
    alpha[rows, columns] = np.clip((solved - HAZE) / (1 - 2 * HAZE), 0, 1)
    return alpha


def share_of_colours(image: np.ndarray, outline: np.ndarray, plate: Plate | None = None) -> np.ndarray:
    """Of each pixel within `NEAR` by itself: the a of its colour = a F + (1 - a) B, F and B the mean colours of both sides.

    image: (H, W, 3) uint8; outline: (H, W) 0..1; plate: as in `soften`. Returns (H, W) float32 alpha, 1 inside, 0 outside.
    """
    hard = (outline > 0.5).astype(np.uint8)
    inside, beyond = cv2.erode(hard, _square(NEAR)), cv2.dilate(hard, _square(NEAR)) == 0
    alpha = inside.astype(np.float32)
    rows, columns = np.nonzero((inside == 0) & ~beyond)
    if len(rows) == 0:
        return alpha
    pad = REACH + 1
    top, left = max(0, rows.min() - pad), max(0, columns.min() - pad)
    window = np.s_[top: rows.max() + pad + 1, left: columns.max() + pad + 1]
    at = rows - top, columns - left
    pixels, inside, beyond = image[window], inside[window], beyond[window].astype(np.uint8)
    colour = _unit(pixels[at])
    in_front, behind = _sum(inside, at), _sum(beyond, at)
    front_seen, back_seen = in_front > 0, behind > 0
    front, back = _mean(pixels, inside, at, in_front), _mean(pixels, beyond, at, behind)
    if plate is not None:
        # The plate has the scene's own texture; the ratio of the means gives it the shadow of this place.
        scene, known = plate.image[window], plate.known[window][at]
        mean = _mean(scene, beyond, at, behind)
        shade = np.where(back_seen[:, None], np.clip((back + 0.02) / (mean + 0.02), 0.5, 2), 1)
        back = np.where(known[:, None], _unit(scene[at]) * shade, back)
        back_seen |= known
    step = front - back
    size = (step * step).sum(axis=1)
    share = np.clip(((colour - back) * step).sum(axis=1) / np.maximum(size, 1e-6), 0, 1)
    trust = np.where(front_seen & back_seen, size / (size + CONTRAST**2), 0)
    smooth = cv2.GaussianBlur(outline[window].astype(np.float32), (0, 0), 1)[at]
    alpha[rows, columns] = trust * share + (1 - trust) * smooth
    return alpha


def _square(reach: int) -> np.ndarray:
    """The neighbourhood of so many px to each side."""
    return np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)


def _mean(image: np.ndarray, weight: np.ndarray, at: tuple, count: np.ndarray) -> np.ndarray:
    """image: (h, w, 3) uint8; weight: (h, w) uint8, 0 or 1; at: rows and columns of n pixels; count: (n,) sums of the weight.

    Returns (n, 3) the mean colour, 0..1, of the weighted pixels in each one's window; 0 where there is none.
    """
    return _unit(_sum(cv2.bitwise_and(image, image, mask=weight), at)) / np.maximum(count, 1)[:, None]


def _sum(image: np.ndarray, at: tuple) -> np.ndarray:
    """image: (h, w, ...) uint8. Returns (n, ...) float32, its sums over the windows of n pixels."""
    size = (2 * REACH + 1, 2 * REACH + 1)
    return cv2.boxFilter(image, cv2.CV_32F, size, normalize=False, borderType=cv2.BORDER_REFLECT)[at]


def _unit(colour: np.ndarray) -> np.ndarray:
    """colour: (..., 3), 0..255. Returns it as float32, 0..1."""
    return colour.astype(np.float32) / 255
