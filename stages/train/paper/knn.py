"""The neighbour term of recipe `paper`: pulls each gaussian towards the look and the place of its nearest ones."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from gsac.avatar.numba_kernel import own_kernel

K = 3
"""Gaussians of a neighbourhood, the gaussian itself included."""
RENEW = 50
"""Steps between two searches for the neighbours; they hardly change."""


class Neighbours:
    """index: (N, K) int, the nearest gaussians of each, itself among them."""

    def __init__(self):
        self.index = np.zeros((0, K), np.int64)

    def distance_gradient(self, places: np.ndarray, weight: float, step: int) -> np.ndarray:
        """Gradient (N, 3) of weight * mean squared distance to the neighbours. places: (N, 3) m."""
        if len(self.index) != len(places) or step % RENEW == 0:
            self.index = cKDTree(places).query(places, k=K)[1]
        gradient = np.zeros((len(places), 3), np.float32)
        _distances(places.astype(np.float32), self.index, 2 * weight / self.index.size, gradient)
        return gradient

    def spread_gradient(self, values: np.ndarray, weight: float) -> np.ndarray:
        """Gradient (N, C) of weight * mean over gaussians and columns of the neighbourhood's standard deviation.

        values: (N, C).
        """
        gradient = np.zeros_like(values)
        _spread(values, self.index, weight / values.size, gradient)
        return gradient


@own_kernel(error_model="numpy")
def _distances(places, index, factor, gradient):
    for i in range(index.shape[0]):
        for j in index[i]:
            for c in range(3):
                pull = factor * (places[i, c] - places[j, c])
                gradient[i, c] += pull
                gradient[j, c] -= pull


@own_kernel(error_model="numpy")
def _spread(values, index, factor, gradient):
    k = index.shape[1]
    for i in range(index.shape[0]):
        for c in range(values.shape[1]):
            mean = 0.0
            for j in index[i]:
                mean += values[j, c]
            mean /= k
            square = 0.0
            for j in index[i]:
                square += (values[j, c] - mean) ** 2
            deviation = np.sqrt(square / (k - 1))
            if deviation < 1e-9:
                continue
            for j in index[i]:
                gradient[j, c] += factor * (values[j, c] - mean) / ((k - 1) * deviation)
