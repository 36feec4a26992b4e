"""The robust loss of the data terms (Geman and McClure 1987), by iterated reweighting."""

from __future__ import annotations

import numpy as np


def robust(residual: np.ndarray, limit: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cost and the square root of the reweighting of residuals in spreads; beyond `limit` spreads they count less and less."""
    square = residual**2
    shrink = 1 / (1 + square / limit**2)
    return square * shrink, shrink
