"""The area of a gaussian as a flat disc: the product of its two largest standard deviations."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import Bound
from gsac.avatar.numba_kernel import own_kernel


@own_kernel(nogil=True)
def disc_areas(scales):
    """(N,) float64 m2, product of the two larger of scales (N, 3) m."""
    out = np.empty(len(scales))
    for i in range(len(scales)):
        a, b, c = np.float64(scales[i, 0]), np.float64(scales[i, 1]), np.float64(scales[i, 2])
        least, most = min(a, b), max(a, b)
        out[i] = max(least, min(most, c)) * max(most, c)
    return out


def divisible_areas(bound: Bound) -> np.ndarray:
    """(N,) m2, `disc_areas` in the precision of the gaussians and above 0: what pixels are divided by."""
    return np.maximum(disc_areas(bound.scales).astype(bound.scales.dtype), 1e-12)
