"""Artifacts in which nothing is seen: every array that a shapes table names."""

from collections.abc import Mapping

import numpy as np

from gsac.avatar.artifacts import TEXT, WHOLE

LENGTHS = {"T": 3, "B": 16, "E": 52, "S": 1404, "L": 468, "N": 5, "F": 4, "X": 50}

def blank(shapes: Mapping[str, tuple], **lengths: int) -> dict[str, np.ndarray]:
    """Zeros of the shapes, float32 or what the array must be; lengths: of letters, where they are not those of `LENGTHS`."""
    lengths = LENGTHS | lengths
    return {name: np.array("none") if name in TEXT
            else np.zeros([lengths.get(n, n) for n in shape], np.int32 if name in WHOLE else np.float32)
            for name, shape in shapes.items()}
