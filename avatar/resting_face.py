"""The person's face at rest: of each action, what lasts.

Nobody is filmed with a neutral face. In a clip in which a person speaks, smiles and blinks, the mean of the frames has a half-open
mouth and half-closed lids; what an action hardly ever falls below belongs to the face itself.
"""

from __future__ import annotations

import numpy as np

LASTING = 0.25
"""Share of what was seen that may lie below an action's rest: the middle of the half with the mouth more closed, lids more open."""
LEAST_FACING = 0.05
"""Cosine to the camera that a face counts with at least."""


def find_resting_face(c: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """(E,) at rest, of actions c (V, E), 0..1, in V >= 1 frames. facing: (V,) cosine between where the face looks and the camera.

    The lower quartile of each action; a frame counts by how far the face looks into the camera.
    """
    weight = np.maximum(facing, LEAST_FACING) ** 2
    order = np.argsort(c, axis=0, kind="stable")
    below = np.cumsum(weight[order], axis=0)
    first = (below >= LASTING * weight.sum()).argmax(axis=0)
    return np.take_along_axis(c, order, axis=0)[first, np.arange(c.shape[1])]
