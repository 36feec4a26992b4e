"""Quaternions xyzw in batches, float64: the operations of retargeting, the same as in the viewer's quat.js."""

from __future__ import annotations

import numpy as np

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product (..., 4) of a (..., 4) and b (..., 4): first b, then a."""
    ax, ay, az, aw = np.moveaxis(np.asarray(a, float), -1, 0)
    bx, by, bz, bw = np.moveaxis(np.asarray(b, float), -1, 0)
    return np.stack([aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                     aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz], axis=-1)


def inverse(a: np.ndarray) -> np.ndarray:
    """Inverse of a (..., 4), unit length."""
    return np.asarray(a, float) * (-1, -1, -1, 1)


def rotate(a: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors v (..., 3) turned by a (..., 4), unit length."""
    a, v = np.broadcast_arrays(np.asarray(a, float)[..., :, None], np.asarray(v, float)[..., None, :])
    xyz, w, v = a[..., :3, 0], a[..., 3:, 0], v[..., 0, :]
    t = 2 * np.cross(xyz, v)
    return v + w * t + np.cross(xyz, t)


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Smallest turn (4,) from direction a (3,) to direction b (3,), any lengths; opposite ones: about a normal of a."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    w = 1 + a @ b
    if w < 1e-9:
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return np.append(axis / np.linalg.norm(axis), 0.0)
    q = np.append(np.cross(a, b), w)
    return q / np.linalg.norm(q)


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Turn (4,) by `angle`, rad, about axis (3,), unit length."""
    return np.append(np.sin(angle / 2) * np.asarray(axis), np.cos(angle / 2))


def mix(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """Unit quaternions (..., 4) between a (..., 4) and b (..., 4) on the shorter arc; share: 0 gives a, 1 gives b."""
    sign = np.where((a * b).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    out = (1 - share) * a + share * sign * b
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def from_columns(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Rotation (4,) that takes the axes to the orthonormal x, y, z, (3,) each."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(np.stack([x, y, z], axis=1)).as_quat()


def from_rotvec(rotvec: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) of rotvec (..., 3), axis-angle, rad."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.asarray(rotvec, float).reshape(-1, 3)).as_quat().reshape(*np.shape(rotvec)[:-1], 4)


def to_rotvec(a: np.ndarray) -> np.ndarray:
    """Axis-angle (..., 3), rad, at most pi long, of a (..., 4)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.asarray(a, float).reshape(-1, 4)).as_rotvec().reshape(*np.shape(a)[:-1], 3)
