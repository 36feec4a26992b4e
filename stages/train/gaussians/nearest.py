"""Nearest neighbours among places."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.threads import kernel_threads

MANY = 10000
"""Queries from which on several threads are worth it: each call starts them anew, which takes long beside busy ones."""


def find_nearest(places: np.ndarray, queries: np.ndarray, count: int) -> np.ndarray:
    """(M, K) indices of the places (N, D) nearest to each of queries (M, D), nearest first; K is `count`, at most N."""
    most = min(count, len(places))
    threads = kernel_threads() if len(queries) >= MANY else 1
    return KDTree(places).query(queries, k=most, workers=threads)[1].reshape(len(queries), most)


def find_nearest_among(places: np.ndarray, some: np.ndarray, which: np.ndarray, count: int) -> np.ndarray:
    """(M, K) indices of the places (N, D), only those in `some` (L,), that are nearest to places `which` (M,); K is at most L."""
    return some[find_nearest(places[some], places[which], count)]
