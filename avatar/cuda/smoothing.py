"""Smoothing on a mesh: (I + lambda L)^-1 and its square, L the uniform Laplacian, as series of Chebyshev polynomials of L.

A term costs the kernels one pass over the neighbours, and both series share their terms.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import eigsh

from gsac.avatar.cuda.adjacency import vertex_neighbours

TERMS = 72
"""At lambda 30 on the open body the series are right to 0.2 and 2 percent in the worst mode, and to a tenth of that in most."""
MARGIN = 1.03
"""Factor on the largest eigenvalue, which is found to a percent."""


class Series(NamedTuple):
    factors: np.ndarray
    """(TERMS, 2) of the polynomials: of the inverse, and of its square."""
    middle: float
    """Of the range of eigenvalues of I + lambda L; the polynomials are in (I + lambda L - middle) / half."""
    half: float
    """Half the width of that range."""


def smoothing_series(faces: np.ndarray, vertices: int, smoothness: float) -> Series:
    """The series for one mesh. faces: (F, 3) int; smoothness: lambda."""
    return _smoothing_series(np.ascontiguousarray(faces, np.int64).tobytes(), vertices, smoothness)


@lru_cache(maxsize=2)
def _smoothing_series(faces: bytes, vertices: int, smoothness: float) -> Series:
    start, near = vertex_neighbours(np.frombuffer(faces, np.int64).reshape(-1, 3), vertices)
    laplacian = diags(np.diff(start).astype(float)) - csr_matrix((np.ones(len(near)), near, start), (vertices, vertices))
    begin = np.sin(np.arange(vertices, dtype=float))
    top = eigsh(laplacian, k=1, which="LA", tol=1e-2, v0=begin, return_eigenvectors=False)[0]
    half = smoothness * MARGIN * top / 2
    at = np.cos((np.arange(1000) + 0.5) * np.pi / 1000)
    eigenvalue = 1 + half + half * at
    terms = chebvander(at, TERMS - 1)
    factors = [np.linalg.lstsq(terms * eigenvalue[:, None] ** power, np.ones(len(at)), rcond=None)[0] for power in (1, 2)]
    return Series(np.stack(factors, 1), 1 + half, half)
