"""The soft edge: how much of each pixel near the outline is person, from the mean colours on both sides of it."""

from __future__ import annotations

import cv2
import numpy as np

BAND = 2
"""Pixels on each side of the outline that are mixed anew."""
REACH = 5
"""Half width, px, of the window in which the colours of both sides are averaged."""
CONTRAST = 0.1
"""Distance of both colours (RGB, 0..1) from which on they are believed half; below, the outline itself is."""


def soften(image: np.ndarray, outline: np.ndarray, plate: np.ndarray | None = None, band: int = BAND) -> np.ndarray:
    """image: (H, W, 3) uint8; outline: (H, W) 0..1; plate: the empty scene (H, W, 3) uint8, in the frame's exposure.

    Returns (H, W) float32 alpha: 1 inside, 0 outside, in the band the share a of colour = a F + (1 - a) B.
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
    colour = image[window].astype(np.float32) / 255
    front, front_weight = _mean(colour, inside[window].astype(np.float32))
    back, back_weight = _mean(colour, beyond[window].astype(np.float32))
    if plate is not None:
        # The plate knows the scene's own texture; the ratio of the means brings it into this place's shadow.
        scene = plate[window].astype(np.float32) / 255
        mean, _ = _mean(scene, beyond[window].astype(np.float32))
        back = np.where(back_weight[..., None] > 0, scene * np.clip((back + 0.02) / (mean + 0.02), 0.5, 2), scene)
        back_weight = np.ones_like(back_weight)
    step = front - back
    size = (step * step).sum(axis=2)
    share = np.clip(((colour - back) * step).sum(axis=2) / np.maximum(size, 1e-6), 0, 1)
    trust = np.where((front_weight > 0) & (back_weight > 0), size / (size + CONTRAST**2), 0)
    smooth = cv2.GaussianBlur(outline[window].astype(np.float32), (0, 0), 1)
    mixed = trust * share + (1 - trust) * smooth
    rows, columns = rows - top, columns - left
    alpha[window][rows, columns] = mixed[rows, columns]
    return alpha


def _mean(colour: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean colour (h, w, 3) of the weighted pixels of each window, and their share (h, w), 0 where there are none."""
    size = (2 * REACH + 1, 2 * REACH + 1)
    share = cv2.boxFilter(weight, -1, size, borderType=cv2.BORDER_REFLECT)
    total = cv2.boxFilter(colour * weight[..., None], -1, size, borderType=cv2.BORDER_REFLECT)
    share = np.where(share > 1e-3, share, 0)
    return total / np.maximum(share, 1e-6)[..., None], share
