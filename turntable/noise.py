"""Smooth noise over space: the material of textures and bumps."""

from __future__ import annotations

import numpy as np

from gsac.avatar.numba_kernel import own_kernel

SIZE = 32


def make_noise(rng: np.random.Generator) -> np.ndarray:
    """(32, 32, 32, 3) float32 in -1..1; it repeats in space."""
    return rng.uniform(-1, 1, (SIZE, SIZE, SIZE, 3)).astype(np.float32)


def sample_noise(noise: np.ndarray, points: np.ndarray, frequency: float | tuple[float, float, float]) -> np.ndarray:
    """noise: (32, 32, 32, 3); points: (N, 3) m; frequency: cells a metre, one or one an axis. Returns (N, 3), trilinear."""
    return _sample_noise(noise, (points * np.asarray(frequency, np.float32)).astype(np.float32))


@own_kernel(error_model="numpy")
def _sample_noise(noise, points):
    out = np.zeros((len(points), 3), np.float32)
    m = SIZE - 1
    for i in range(len(points)):
        fx, fy, fz = np.floor(points[i, 0]), np.floor(points[i, 1]), np.floor(points[i, 2])
        x, y, z = int(fx), int(fy), int(fz)
        u, v, w = points[i, 0] - fx, points[i, 1] - fy, points[i, 2] - fz
        for a in range(2):
            for b in range(2):
                for c in range(2):
                    k = (u if a else 1 - u) * (v if b else 1 - v) * (w if c else 1 - w)
                    for d in range(3):
                        out[i, d] += k * noise[(x + a) & m, (y + b) & m, (z + c) & m, d]
    return out
