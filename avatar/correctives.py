"""Pose correctives: what a turned joint does to the surface beside skinning (Pavlakos et al. 2019, eq. 2 and 4).

Each joint but the root moves the vertices at rest by nine directions times its rotation less the identity, row by row. V vertices,
J = 55 joints, D = 9 (J - 1) directions.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import J
from gsac.avatar.skinning import rotation_matrices, rotation_matrices_backward

DIRECTIONS = 9 * (J - 1)


def turn_features(local: np.ndarray) -> np.ndarray:
    """(..., D), the rotations but the root's less the identity. local: (..., J, 3, 3), against the parents."""
    less = local[..., 1:, :, :] - np.eye(3, dtype=local.dtype)
    return less.reshape(*local.shape[:-3], DIRECTIONS)


def move_rest(posedirs: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """(V, 3) m that a pose adds to the vertices at rest. posedirs: (V, 3, D) m; pose: (J, 3) axis-angle."""
    features = turn_features(rotation_matrices(pose)).astype(posedirs.dtype)
    return (posedirs.reshape(-1, DIRECTIONS) @ features).reshape(-1, 3)


def move_rest_backward(posedirs: np.ndarray, pose: np.ndarray, grad: np.ndarray) -> np.ndarray:
    """Gradient of the pose (J, 3) through `move_rest` from grad (V, 3), that of the vertices at rest.

    posedirs: (V, 3, D) m; pose: (J, 3) axis-angle.
    """
    grad_local = np.zeros((J, 3, 3), np.float64)
    grad_local[1:] = (grad.reshape(-1) @ posedirs.reshape(-1, DIRECTIONS)).reshape(-1, 3, 3)
    return rotation_matrices_backward(pose, grad_local)
