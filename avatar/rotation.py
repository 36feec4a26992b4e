"""Rotation vectors, matrices and the order of quaternions, in batches; float64 where the fit differentiates through it."""

from __future__ import annotations

import numpy as np


def exp(rotvec: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotvec (..., 3), rad."""
    angle = np.linalg.norm(rotvec, axis=-1)[..., None, None]
    k = hat(rotvec)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1 - angle**2 / 6, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + a * k + b * (k @ k)


def log(matrix: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3), rad, at most pi long, of matrix (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_rotvec().reshape(*matrix.shape[:-2], 3)


def hat(v: np.ndarray) -> np.ndarray:
    """Cross-product matrices (..., 3, 3) of v (..., 3)."""
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def log_derivative(rotvec: np.ndarray) -> np.ndarray:
    """rotvec: (..., 3) rad. Returns (..., 3, 3): how log(R exp(delta)) moves with delta at R = exp(rotvec) (inverse right
    Jacobian)."""
    angle2 = (rotvec**2).sum(-1)[..., None, None]
    k = hat(rotvec)
    small = angle2 < 1e-8
    angle = np.sqrt(np.where(small, 1.0, angle2))
    b = np.where(small, 1 / 12, 1 / angle**2 - (1 + np.cos(angle)) / (2 * angle * np.sin(angle) + 1e-12))
    return np.eye(3) + 0.5 * k + b * (k @ k)


def by_turns(rotvec: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Gradient (..., 3) by a turn about the axes after the rotation. rotvec: (..., 3) rad; gradient: (..., 3), by rotvec."""
    return np.einsum("...ba,...b->...a", log_derivative(rotvec), gradient)


def align(source: np.ndarray, target: np.ndarray, weight: np.ndarray | None = None) -> np.ndarray:
    """Rotation (3, 3) that best turns centred source (P, 3) onto centred target (P, 3); weight: (P,), one unless given (Kabsch)."""
    w = np.ones(len(source)) if weight is None else weight
    a = source - np.average(source, axis=0, weights=w)
    b = target - np.average(target, axis=0, weights=w)
    u, _, vt = np.linalg.svd((w[:, None] * a).T @ b)
    d = np.sign(np.linalg.det(vt.T @ u.T))
    return vt.T @ np.diag([1, 1, d]) @ u.T


def about_y(angle: float) -> np.ndarray:
    """(3, 3): a turn by `angle` rad about y, which takes z to x."""
    return np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])


def to_wxyz(xyzw: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) in the gaussians' order, from xyzw (..., 4), scipy's."""
    return xyzw[..., [3, 0, 1, 2]]


def to_xyzw(wxyz: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) in scipy's order, from wxyz (..., 4), the gaussians'."""
    return wxyz[..., [1, 2, 3, 0]]
