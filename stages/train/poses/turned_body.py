"""The body, turned before a camera that sees all of it."""

from __future__ import annotations

import numpy as np

from gsac.avatar.camera import Camera
from gsac.avatar.rotation import about_y

SIZE = 240
"""px, side of these images."""


def turn_before_camera(vertices: np.ndarray, degrees: float) -> tuple[np.ndarray, Camera, float]:
    """Turns the body, vertices (V, 3) m, about the upright axis before a camera that sees all of it.

    Returns vertices (V, 3) m in the camera frame, the camera, and px for each m.
    """
    turn = about_y(np.radians(degrees))
    middle = (vertices.min(0) + vertices.max(0)) / 2
    half = float(np.linalg.norm(vertices - middle, axis=1).max())
    placed = (vertices - middle) @ (np.diag([1.0, -1.0, -1.0]) @ turn).T + [0, 0, 6 * half]
    focal = SIZE * 2.8
    return placed.astype(np.float32), Camera((focal, focal), (SIZE / 2, SIZE / 2), SIZE, SIZE), focal / (6 * half)
