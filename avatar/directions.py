"""Directions from all round, evenly spread."""

from __future__ import annotations

import numpy as np


def spread_directions(count: int, ahead: float = 0.0) -> np.ndarray:
    """(count, 3) unit vectors, from z down to -z: a Fibonacci lattice. ahead: the first one's turn about z, in steps."""
    height = 1 - (2 * np.arange(count) + 1) / count
    around, radius = np.pi * (1 + 5**0.5) * (np.arange(count) + ahead), np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(around), radius * np.sin(around), height], 1)
