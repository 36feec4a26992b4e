"""The soft edge's course from pixel to pixel: closed-form matting (Levin et al. 2008) where the network's alpha is not sure."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.stages.segment.matting_kernels import matting_rows, solve_rows

SURE = 0.02
"""Alpha up to which a pixel is surely the scene's, and below 1 the person's."""
NOISE = 3e-5
"""Variance of a colour (0..1) within one surface."""
HOLD = 2.0
"""Weight of a pixel's alpha as it was beside the matting Laplacian, whose diagonal is about 8."""
STEPS = 8
"""Of the solver, after which the error of alpha no longer falls."""
HAZE = 0.1
"""Alpha that counts as none, and below 1 as whole: a smooth solution leaves so much of each side beyond the edge."""


def settle(image: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """image: (H, W, 3) uint8; alpha: (H, W) float32.

    Returns (H, W) float32 alpha: where it was not sure the solution of closed-form matting that is held to it.
    """
    unsure = (alpha > SURE) & (alpha < 1 - SURE)
    rows, columns = np.nonzero(unsure)
    if len(rows) == 0 or min(alpha.shape) < 3:
        return alpha
    order = np.full(alpha.shape, -1, np.int32)
    order[rows, columns] = np.arange(len(rows))
    windows = np.zeros(alpha.shape, np.uint8)
    windows[1:-1, 1:-1] = cv2.dilate(unsure.astype(np.uint8), np.ones((3, 3), np.uint8))[1:-1, 1:-1]
    laplacian, pulls = matting_rows(image, order, alpha, np.argwhere(windows), NOISE)
    first, width = alpha[rows, columns], alpha.shape[1] + 4
    laplacian[:, 2, 2] += HOLD
    settled = alpha.copy()
    settled[rows, columns] = solve_rows(laplacian, (rows + 2) * width + columns + 2, width, pulls + np.float32(HOLD) * first, first,
                                        STEPS)
    return np.clip((settled - HAZE) / (1 - 2 * HAZE), 0, 1)
