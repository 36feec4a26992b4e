"""The person's own colour in the soft edge, where a frame's colour is mixed with the background's."""

from __future__ import annotations

import cv2
import numpy as np

SURE = 0.98
"""Alpha from which on a pixel's colour is the person's alone."""
REACH = 6.0
"""px, longest way to a sure pixel."""


def unmix(rgb: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """The frame with the nearest sure pixel's colour in the soft edge.

    rgb: (H, W, 3) uint8; alpha: (H, W) in 0..1. Returns (H, W, 3) uint8.
    """
    sure = alpha >= SURE
    edge = np.flatnonzero((alpha > 0) & ~sure)
    if not len(edge) or not sure.any():
        return rgb
    away, label = cv2.distanceTransformWithLabels((~sure).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    label = label.astype(np.intp)
    place = np.empty(label.max() + 1, np.intp)
    place[label[sure]] = np.flatnonzero(sure)
    edge = edge[away.ravel()[edge] <= REACH]
    flat = rgb.reshape(-1, 3).copy()
    flat[edge] = flat[place[label.ravel()[edge]]]
    return flat.reshape(rgb.shape)
