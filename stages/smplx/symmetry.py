"""Offsets that left and right share: x of the right side is minus x of the left; points of the body's middle have no x."""

from __future__ import annotations

import numpy as np


def mirror_directions(spreads: dict[str, tuple], index: dict[str, int], rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions (rows, 3, K) m a unit of K unknowns that move left and right alike, and the unknowns' standard deviations (K,) m.

    spreads: name without its side -> mm along x, y, z; an axis of 0 is left out; index: name with its side -> row.
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
