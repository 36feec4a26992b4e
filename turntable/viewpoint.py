"""Where a camera stands in the world. World: y up; camera frame: OpenCV axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.camera import Camera


@dataclass
class Viewpoint:
    """A camera and its place."""

    camera: Camera
    rotation: np.ndarray
    """(3, 3) world -> camera."""
    eye: np.ndarray
    """(3,) m, world."""

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        """points: (..., 3) m, world. Returns (..., 3) m, camera frame."""
        return (points - self.eye) @ self.rotation.T

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """points: (..., 3) m, camera frame. Returns (..., 3) m, world."""
        return points @ self.rotation + self.eye


def look_at(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """eye, target: (3,) m, world. Returns the rotation (3, 3) world -> camera that puts target on the optical axis, no roll."""
    forward = target - eye
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])
