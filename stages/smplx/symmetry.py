"""Directions that left and right share: x of the right side is minus x of the left, and the middle of the body stays in it."""

from __future__ import annotations

import numpy as np


def mirror_directions(spreads: dict[str, tuple], index: dict[str, int], rows: int) -> tuple[np.ndarray, np.ndarray]:
    """spreads: name without its side -> mm along x, y, z; 0 leaves an axis out, and so does the middle of the body for x.

    Returns (rows, 3, K) metres a unit of each unknown, and their spreads (K,) m.
    """
    columns, metres = [], []
    for name, spread in spreads.items():
        for axis in np.flatnonzero(spread):
            column = np.zeros((rows, 3))
            if name in index:
                if axis == 0:
                    continue
                column[index[name], axis] = 1
            else:
                column[index[f"left_{name}"], axis] = 1
                column[index[f"right_{name}"], axis] = -1 if axis == 0 else 1
            columns.append(column)
            metres.append(spread[axis] / 1e3)
    return np.stack(columns, 2) if columns else np.zeros((rows, 3, 0)), np.array(metres)
