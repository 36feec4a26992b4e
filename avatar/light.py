"""The light of a clip: how a surface's colour changes with the way it faces, the same for all gaussians.

The camera stands still and so do the lamps, while the person turns: in the room the light is fixed, and a diffuse surface
under distant lamps takes it in as a smooth function of its normal n (Ramamoorthi and Hanrahan, 2001). Its first order is
all that measured better than none here: shade = light . (1, n_x, n_y, |n_z|), in the avatar's axes
when it faces the clip's camera: x to its left, y up, z to the camera. That camera saw no surface that looks away from it; those
are lit as if the room were the same behind.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.blend import BRIGHTEST, DARKEST

TERMS = 4
FROM_CAMERA = np.float32([1, -1, -1])
"""Of a normal in the clip's camera frame: times this, it is in the light's axes."""


def basis(normals: np.ndarray) -> np.ndarray:
    """normals: (N, 3) unit, in the light's axes. Returns (N, TERMS)."""
    return np.concatenate([np.ones((len(normals), 1), normals.dtype), normals[:, :2], np.abs(normals[:, 2:])], 1)


def shade(light: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) factors of the colours. light: (TERMS, 3); normals: (N, 3) unit, in the light's axes."""
    return np.clip(basis(normals) @ light.astype(normals.dtype), DARKEST, BRIGHTEST)
