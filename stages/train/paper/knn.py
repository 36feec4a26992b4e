"""The neighbour term of recipe `paper`: pulls each posed gaussian towards the look and the place of its nearest ones.

HAHA's term, after GART (Lei et al. 2023): the mean over gaussians and columns of the standard deviation inside a neighbourhood, of
posed rotations, posed scales and colours, and the mean squared distance to its members. The opacities are all the same here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.numba_kernel import own_kernel

K = 3
"""Gaussians of a neighbourhood, the gaussian itself included."""


class Pull(NamedTuple):
    """Value of the term and its gradients."""

    value: float
    places: np.ndarray
    """(N, 3)."""
    rotations: np.ndarray
    """(N, 3, 3), of the free matrix."""
    scales: np.ndarray
    """(N, 3)."""
    rgb: np.ndarray
    """(N, 3)."""


def pull_together(places: np.ndarray, rotations: np.ndarray, scales: np.ndarray, rgb: np.ndarray, weight: float) -> Pull:
    """weight * the term, of posed gaussians. places: (N, 3) m; rotations: (N, 3, 3); scales: (N, 3) m; rgb: (N, 3)."""
    index = find_nearest(places)
    quats = posed_quats(rotations)
    value, on_places = distances(places, index, weight)
    grads = []
    for values in (quats, scales, rgb):
        spread, grad = deviations(values, index, weight)
        value += spread
        grads.append(grad)
    return Pull(value, on_places, through_quats(quats, grads[0], rotations), grads[1], grads[2])


def find_nearest(places: np.ndarray) -> np.ndarray:
    """(N, K) int, the nearest of each of places (N, 3), itself among them."""
    return np.asarray(KDTree(places).query(places, k=K)[1])


def posed_quats(rotations: np.ndarray) -> np.ndarray:
    """(N, 4) wxyz of length one, w >= 0, of rotations (N, 3, 3): of the two quaternions of a rotation the one HAHA compares."""
    quats = np.empty((len(rotations), 4), rotations.dtype)
    _quats(rotations, quats)
    return quats


def through_quats(quats: np.ndarray, grad: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Gradient (N, 3, 3) by rotations (N, 3, 3) from grad (N, 4), that by their quats (N, 4): right for turns of the rotation."""
    w, v, of_w, of_v = quats[:, :1], quats[:, 1:], grad[:, :1], grad[:, 1:]
    turn = (w * of_v - of_w * v + np.cross(v, of_v)) / 4  # half of the gradient by a turn from the left
    return np.cross(turn[:, None], rotations, axisb=1, axisc=1)


def distances(places: np.ndarray, index: np.ndarray, weight: float) -> tuple[float, np.ndarray]:
    """weight * mean squared distance to the neighbours, and its gradient (N, 3). places: (N, 3) m; index: (N, K)."""
    gradient = np.zeros_like(places)
    return weight / index.size * _distances(places, index, 2 * weight / index.size, gradient), gradient


def deviations(values: np.ndarray, index: np.ndarray, weight: float) -> tuple[float, np.ndarray]:
    """weight * mean over gaussians and columns of the neighbourhood's standard deviation, and its gradient (N, C).

    values: (N, C); index: (N, K).
    """
    gradient = np.zeros_like(values)
    return weight / values.size * _deviations(values, index, weight / values.size, gradient), gradient


@own_kernel(error_model="numpy")
def _distances(places, index, factor, gradient):
    total = 0.0
    for i in range(index.shape[0]):
        for j in index[i]:
            for c in range(3):
                away = places[i, c] - places[j, c]
                total += away * away
                gradient[i, c] += factor * away
                gradient[j, c] -= factor * away
    return total


@own_kernel(error_model="numpy")
def _deviations(values, index, factor, gradient):
    k, total = index.shape[1], 0.0
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
            total += deviation
            if deviation < 1e-9:
                continue
            for j in index[i]:
                gradient[j, c] += factor * (values[j, c] - mean) / ((k - 1) * deviation)
    return total


@own_kernel(error_model="numpy")
def _quats(rotations, quats):
    for i in range(rotations.shape[0]):
        m = rotations[i]
        sizes = (m[0, 0] + m[1, 1] + m[2, 2], m[0, 0] - m[1, 1] - m[2, 2], m[1, 1] - m[0, 0] - m[2, 2], m[2, 2] - m[0, 0] - m[1, 1])
        largest = 0
        for c in range(1, 4):
            if sizes[c] > sizes[largest]:
                largest = c
        own = 0.5 * np.sqrt(1.0 + sizes[largest])
        x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
        xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
        f = 0.25 / own
        if largest == 0:
            a, b, c, d = own, x * f, y * f, z * f
        elif largest == 1:
            a, b, c, d = x * f, own, xy * f, xz * f
        elif largest == 2:
            a, b, c, d = y * f, xy * f, own, yz * f
        else:
            a, b, c, d = z * f, xz * f, yz * f, own
        sign = -1.0 if a < 0 else 1.0
        quats[i, 0], quats[i, 1], quats[i, 2], quats[i, 3] = sign * a, sign * b, sign * c, sign * d
