"""The person's probability for each pixel, by a network: rough at the outline."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.logistic import clipped_sigmoid
from gsac.avatar.region import Region, around_points, crop
from gsac.avatar.tflite import Network

MARGIN = 1.2
"""Side of the network's square crop, in sides of the points' square: crown and toes lie beyond the points."""


PersonMask = Callable[[np.ndarray, Region], np.ndarray]
"""(image (H, W, 3) uint8, region) -> (H, W) float32, the person's probability, 0 outside the region."""


class PoseMask:
    """The person mask of the body network."""

    def __init__(self, models: dict[str, Path]):
        self._network = Network(models["pose_landmark_full"])

    def __call__(self, image: np.ndarray, region: Region) -> np.ndarray:
        """image: (H, W, 3) uint8. Returns (H, W) float32, the person's probability, 0 outside the region."""
        size = self._network.width
        mask = next(o for o in self._network(crop(image, region, size)) if o.shape == (size, size, 1))
        return onto_frame(clipped_sigmoid(mask[..., 0]), region, *image.shape[:2])


class SelfieMask:
    """The mask of the selfie network."""

    def __init__(self, models: dict[str, Path]):
        self._network = Network(models["selfie_segmentation"])

    def __call__(self, image: np.ndarray, region: Region) -> np.ndarray:
        """image: (H, W, 3) uint8. Returns (H, W) float32, the person's probability, 0 outside the region."""
        return onto_frame(self._network(crop(image, region, self._network.width))[0][..., 0], region, *image.shape[:2])


def person_region(xy: np.ndarray, score: np.ndarray) -> Region | None:
    """xy: (n, 2) px; score: (n,). Returns the square around the seen points; None where fewer than three were seen."""
    seen = xy[score > 0]
    return around_points(seen).scaled(MARGIN) if len(seen) >= 3 else None


def onto_frame(mask: np.ndarray, region: Region, height: int, width: int) -> np.ndarray:
    """mask: (n, n) over the region. Returns (height, width) float32, 0 outside the region."""
    n = len(mask)
    inverse = np.linalg.inv(region.axes * (region.side / n))
    # A pixel's middle lies at +0.5 in frame and mask alike.
    shift = inverse @ (0.5 - np.asarray(region.center)) + n / 2 - 0.5
    matrix = np.hstack([inverse, shift[:, None]])
    return cv2.warpAffine(mask.astype(np.float32), matrix, (width, height),
                          flags=cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR)
