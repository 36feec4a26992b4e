"""Height of a person in a picture, which decides the level of detail (docs/gsac-format.md, Level)."""

from __future__ import annotations

import numpy as np


def person_height(stature: float, joints: np.ndarray, focal: float) -> float:
    """px: of a body `stature` m high at rest, where the joint nearest to the eye is.

    joints: (J, 3) m, posed, camera frame; focal: focal length over the picture's height, px.
    """
    return float(focal * stature / np.linalg.norm(joints, axis=1).min())
