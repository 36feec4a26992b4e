"""The soft edge: the alpha of each pixel near the outline, from the mean colours on both sides of it."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.stages.segment.plate import Plate

BAND = 2
"""Pixels on each side of the outline whose alpha is computed."""
REACH = 5
"""Half width, px, of the window in which the colours of both sides are averaged."""
CONTRAST = 0.1
"""Distance of both colours (RGB, 0..1) at which alpha is half theirs, half the smoothed outline's; less distance, more outline."""


def soften(image: np.ndarray, outline: np.ndarray, plate: Plate | None = None, band: int = BAND) -> np.ndarray:
    """image: (H, W, 3) uint8; outline: (H, W) 0..1; plate: the empty scene in the frame's exposure.

    Returns (H, W) float32 alpha: 1 inside, 0 outside, in the band the a of colour = a F + (1 - a) B.
    """
    hard = (outline > 0.5).astype(np.uint8)
    around = np.ones((2 * band + 1, 2 * band + 1), np.uint8)
    inside, beyond = cv2.erode(hard, around), cv2.dilate(hard, around) == 0
    alpha = inside.astype(np.float32)
    rows, columns = np.nonzero((inside == 0) & ~beyond)
    if len(rows) == 0:
        return alpha
    pad = REACH + 1
    top, left = max(0, rows.min() - pad), max(0, columns.min() - pad)
    window = np.s_[top: rows.max() + pad + 1, left: columns.max() + pad + 1]
    at = rows - top, columns - left
    colour = image[window].astype(np.float32) / 255
    inside, beyond = inside[window].astype(np.float32), beyond[window].astype(np.float32)
    front, front_seen = _mean(colour, inside, at)
    back, back_seen = _mean(colour, beyond, at)
    if plate is not None:
        # The plate has the scene's own texture; the ratio of the means gives it the shadow of this place.
        scene, known = plate.image[window].astype(np.float32) / 255, plate.known[window][at]
        mean, _ = _mean(scene, beyond, at)
        shade = np.where(back_seen[:, None], np.clip((back + 0.02) / (mean + 0.02), 0.5, 2), 1)
        back = np.where(known[:, None], scene[at] * shade, back)
        back_seen |= known
    step = front - back
    size = (step * step).sum(axis=1)
    share = np.clip(((colour[at] - back) * step).sum(axis=1) / np.maximum(size, 1e-6), 0, 1)
    trust = np.where(front_seen & back_seen, size / (size + CONTRAST**2), 0)
    smooth = cv2.GaussianBlur(outline[window].astype(np.float32), (0, 0), 1)[at]
    alpha[rows, columns] = trust * share + (1 - trust) * smooth
    return alpha


def _mean(colour: np.ndarray, weight: np.ndarray, at: tuple) -> tuple[np.ndarray, np.ndarray]:
    """colour: (h, w, 3); weight: (h, w) 0 or 1; at: rows and columns of n pixels.

    Returns (n, 3) the mean colour of the weighted pixels in each one's window, and (n,) bool whether there are any.
    """
    size = (2 * REACH + 1, 2 * REACH + 1)
    share = cv2.boxFilter(weight, -1, size, borderType=cv2.BORDER_REFLECT)[at]
    total = cv2.boxFilter(cv2.merge([c * weight for c in cv2.split(colour)]), -1, size, borderType=cv2.BORDER_REFLECT)[at]
    return total / np.maximum(share, 1e-6)[:, None], share > 1e-3
