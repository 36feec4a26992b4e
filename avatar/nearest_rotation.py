"""Quaternions of matrices that are rotations but for rounding: those of the nearest rotation.

scipy finds it by singular values, matrix by matrix; so near to a rotation, Newton's iteration to the polar factor doubles the right
digits each time.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.numba_kernel import own_kernel

ROUNDS = 3
"""Of Newton's iteration: one makes of an error e at most e squared, and float32 rounds at 1e-7."""


def nearest_quaternions(matrices: np.ndarray) -> np.ndarray:
    """(N, 4) float64 wxyz, of length 1, of the rotations nearest to matrices (N, 3, 3)."""
    out = np.empty((len(matrices), 4))
    _nearest_quaternions(np.require(matrices, np.float64, ["C", "W"]), out)
    return out


@own_kernel(nogil=True, error_model="numpy")
def _nearest_quaternions(matrices, out):
    """out (N, 4), written; by Markley's choice of the largest among the diagonal and its sum. matrices: (N, 3, 3)."""
    m, gram, row, quat = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(4)
    for n in range(len(matrices)):
        for a in range(3):
            for b in range(3):
                m[a, b] = matrices[n, a, b]
        for _ in range(ROUNDS):  # m (3 - m^T m) / 2
            for a in range(3):
                for b in range(3):
                    gram[a, b] = m[0, a] * m[0, b] + m[1, a] * m[1, b] + m[2, a] * m[2, b]
            for a in range(3):
                for b in range(3):
                    row[b] = 1.5 * m[a, b] - 0.5 * (m[a, 0] * gram[0, b] + m[a, 1] * gram[1, b] + m[a, 2] * gram[2, b])
                for b in range(3):
                    m[a, b] = row[b]
        trace = m[0, 0] + m[1, 1] + m[2, 2]
        i, most = 3, trace
        for a in range(2, -1, -1):  # the first of equal ones
            if m[a, a] >= most:
                i, most = a, m[a, a]
        if i == 3:
            quat[0], quat[1], quat[2], quat[3] = 1 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
        else:
            j, k = (i + 1) % 3, (i + 2) % 3
            quat[0] = m[k, j] - m[j, k]
            quat[1 + i], quat[1 + j], quat[1 + k] = 1 - trace + 2 * m[i, i], m[j, i] + m[i, j], m[k, i] + m[i, k]
        length = np.sqrt(quat[0] ** 2 + quat[1] ** 2 + quat[2] ** 2 + quat[3] ** 2)
        for c in range(4):
            out[n, c] = quat[c] / length
