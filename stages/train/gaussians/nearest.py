"""Nearest neighbours among places, on all of the kernels' threads."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.threads import kernel_threads


def find_nearest(places: np.ndarray, queries: np.ndarray, count: int) -> np.ndarray:
    """(M, K) indices of the places (N, 3) nearest to each of queries (M, 3), nearest first; K is `count`, at most N."""
    most = min(count, len(places))
    return KDTree(places).query(queries, k=most, workers=kernel_threads())[1].reshape(len(queries), most)
