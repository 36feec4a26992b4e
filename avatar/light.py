"""The light of a clip: how a surface's colour changes with the way it faces, the same for all gaussians.

The camera stands still and so do the lamps, while the person turns: in the camera frame the light is fixed, and a diffuse
surface under distant lamps takes it in as a smooth function of its normal n (Ramamoorthi and Hanrahan, 2001). Its first
order, four numbers a channel, is all that measured better than none here: shade = light . (1, n).
"""

from __future__ import annotations

import numpy as np

TERMS = 4
DARKEST, BRIGHTEST = 0.25, 2.5
"""A shade stays between these: the first order knows no shadow."""


def basis(normals: np.ndarray) -> np.ndarray:
    """normals: (N, 3) unit. Returns (N, TERMS)."""
    return np.concatenate([np.ones((len(normals), 1), normals.dtype), normals], 1)


def shade(light: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) factors of the colours. light: (TERMS, 3); normals: (N, 3) unit, in the light's frame."""
    return np.clip(basis(normals) @ light.astype(normals.dtype), DARKEST, BRIGHTEST)


def turned(light: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """The light in another frame: (3, 3) takes vectors of its frame to those of the other."""
    return np.concatenate([light[:1], rotation @ light[1:]]).astype(light.dtype)
