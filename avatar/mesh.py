"""Normals of a mesh's vertices, and pairs of indices such as its edges."""

from __future__ import annotations

import numpy as np


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """vertices: (V, 3); faces: (F, 3). Returns (V, 3) float64, unit, weighted by area; +z at a vertex without a face."""
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    across = np.cross(b - a, c - a)
    out = np.stack([np.bincount(faces.ravel(), np.repeat(across[:, k], 3), len(vertices)) for k in range(3)], 1)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return np.where(length > 1e-12, out / np.maximum(length, 1e-12), (0, 0, 1))


def distinct_pairs(first: np.ndarray, second: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Each pair (first[n], second[n]) once, ascending. first, second: (N,) int in 0..count - 1. Returns two arrays (M,).

    As `numpy.unique` of numbered pairs, which hashes integers and takes ten times as long.
    """
    numbers = np.sort(first * count + second)
    return np.divmod(numbers[np.append(True, numbers[1:] != numbers[:-1])[:len(numbers)]], count)
