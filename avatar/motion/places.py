"""Turns and places of a tree of nodes in the world, from those relative to their parents."""

from __future__ import annotations

import numpy as np

from gsac.avatar.motion import quat


def place_nodes(local: np.ndarray, parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turns (T, P, 4) and places (T, P, 3) in the world. local: (T, P, 8) place, quaternion and mean scale from the
    parent; parents: (P,), -1 for a root."""
    turns, places, scales = np.array(local[..., 3:7]), np.array(local[..., :3]), np.array(local[..., 7])
    for j, parent in enumerate(parents):
        if parent >= 0:
            places[:, j] = places[:, parent] + quat.rotate(turns[:, parent], places[:, j] * scales[:, parent, None])
            turns[:, j] = quat.multiply(turns[:, parent], turns[:, j])
            scales[:, j] *= scales[:, parent]
    return turns, places
