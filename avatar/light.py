"""The light of a clip's room: a factor on colour by the surface's normal, the same for all gaussians.

Camera and lamps stand still while the person turns, so the light is fixed in the room, and a diffuse surface under distant
lamps receives it as a smooth function of its normal n (Ramamoorthi and Hanrahan, 2001). Of its expansion only the first order
measured better than no light: shade = light . (1, n_x, n_y, |n_z|), in the axes of an avatar that faces the clip's camera: x to
its left, y up, z to the camera. The camera saw no surface that faces away from it; those are lit as if the room were the same
behind.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.draw_rule import BRIGHTEST, DARKEST

TERMS = 4
FROM_CAMERA = np.float32([1, -1, -1])
"""Factor that brings a normal from the clip's camera frame to the light's axes."""


def basis(normals: np.ndarray) -> np.ndarray:
    """The terms that `light` weighs. normals: (N, 3) unit, in the light's axes. Returns (N, TERMS)."""
    return np.concatenate([np.ones((len(normals), 1), normals.dtype), normals[:, :2], np.abs(normals[:, 2:])], 1)


def shade(light: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) factors of the colours, between `DARKEST` and `BRIGHTEST`. light: (TERMS, 3); normals: (N, 3) unit, light's axes."""
    return np.clip(basis(normals) @ light.astype(normals.dtype), DARKEST, BRIGHTEST)
