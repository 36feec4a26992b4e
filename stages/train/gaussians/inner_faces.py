"""Faces of the body that nobody sees from outside, in the closed mouth and behind the eyes.

They lie millimetres behind lips and lids, which gaussians on them would shine through as dots.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.camera import Camera
from gsac.avatar.directions import spread_directions
from gsac.avatar.threads import side_by_side
from gsac.avatar.zbuffer import rasterise, visible_points

SIDES = 32
"""Directions, spread evenly, from which the body is looked at."""
SIZE = 640
"""px, side of these images."""
FAR = 10.0
"""m from the camera to the body's middle."""
SLACK = 0.002
"""m that a face may lie behind the nearest surface: the eyeball's rim under the lids shows once the eye turns."""


def find_inner(rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) bool: no side shows the face's middle. rest: (V, 3) m, with a closed mouth; faces: (F, 3)."""
    centred = rest - (rest.min(0) + rest.max(0)) / 2
    focal = SIZE * FAR / (2 * float(np.linalg.norm(centred, axis=1).max()))
    camera = Camera((focal, focal), (SIZE / 2, SIZE / 2), SIZE, SIZE)

    def show(side: np.ndarray, _: object) -> np.ndarray:
        placed = centred @ axes_along(side).T + [0, 0, FAR]
        return visible_points(placed[faces].mean(1), rasterise(placed, faces, camera)[2], camera, SLACK)

    return ~np.any(side_by_side(show, spread_directions(SIDES)), axis=0)


def axes_along(direction: np.ndarray) -> np.ndarray:
    """(3, 3) rotation, whose last row is the direction (3,), of unit length."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(direction))], direction)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(direction, across), direction])
