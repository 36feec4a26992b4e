"""Pinhole camera. World = camera frame, OpenCV axes (x right, y down, z forward); first pixel's centre is (0.5, 0.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Camera:
    """Focal length, principal point and image size."""

    focal: tuple[float, float]
    """Pixels."""
    center: tuple[float, float]
    """Principal point, pixels."""
    width: int
    height: int

    def project(self, points: np.ndarray) -> np.ndarray:
        """points: (..., 3) m, camera frame. Returns (..., 2) px."""
        return points[..., :2] / points[..., 2:3] * np.asarray(self.focal) + np.asarray(self.center)

    def scaled(self, width: int, height: int) -> Camera:
        """The same view at another image size."""
        sx, sy = width / self.width, height / self.height
        return Camera((self.focal[0] * sx, self.focal[1] * sy), (self.center[0] * sx, self.center[1] * sy), width, height)
