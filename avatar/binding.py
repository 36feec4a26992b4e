"""Binding of gaussians to the faces of a posed mesh, and its gradient.

For a face (v0, v1, v2): a = (v2 - v1)/|.|, n = (v2 - v1) x (v0 - v1)/|.|, b = a x n, R = [a n b], T = mean of the corners,
k = 0.5 (h + L)/0.05 with L = |v0 - v2|, h = 2 area/L. A gaussian then has mean k R mu + T, rotation R r and scales k s
(HAHA sec. 3.2; GSAC eq. 13-15). A face without area has R = I and k = 0, and passes a gradient through T only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from gsac.avatar.nearest_rotation import nearest_quaternions
from gsac.avatar.numba_kernel import kernel
from gsac.avatar.threads import Share, Workspace


class FaceFrames(NamedTuple):
    """The local frame of each face of a posed mesh."""

    R: np.ndarray
    """(F, 3, 3) columns a, n, b."""
    T: np.ndarray
    """(F, 3) m."""
    k: np.ndarray
    """(F,) 0 where not valid."""
    valid: np.ndarray
    """(F,) bool, whether the face has an area."""


class Bound(NamedTuple):
    """Gaussians in space, as their faces carry them."""

    means: np.ndarray
    """(N, 3) m."""
    rotations: np.ndarray
    """(N, 3, 3)."""
    scales: np.ndarray
    """(N, 3) m."""


class BindingGradients(NamedTuple):
    """Gradients of a loss with respect to the gaussians' own values and the mesh."""

    mu: np.ndarray
    """(N, 3)."""
    quat: np.ndarray
    """(N, 4)."""
    log_scale: np.ndarray
    """(N, 3)."""
    vertices: np.ndarray
    """(V, 3)."""


def face_frames(vertices: np.ndarray, faces: np.ndarray) -> FaceFrames:
    """Frames of all faces. vertices: (V, 3) m; faces: (F, 3) int. A zero-area face gets R = I, k = 0, valid False."""
    vertices = kernel_array(vertices)
    count, real = len(faces), vertices.dtype
    frames = FaceFrames(np.empty((count, 3, 3), real), np.empty((count, 3), real), np.empty(count, real),
                        np.empty(count, np.bool_))
    _all_frames(vertices, kernel_array(faces, np.int32), *frames)
    return frames


def bind(frames: FaceFrames, face: np.ndarray, mu: np.ndarray, quat: np.ndarray, log_scale: np.ndarray) -> Bound:
    """Gaussians in space from their values in the frames of their faces.

    face: (N,) int; mu: (N, 3); quat: (N, 4) wxyz, any length (zero is taken as no rotation); log_scale: (N, 3).
    """
    mu = kernel_array(mu)
    out = Bound(np.empty_like(mu), np.empty((len(mu), 3, 3), mu.dtype), np.empty_like(mu))
    _bind(0, 1, frames.R, frames.T, frames.k, kernel_array(face, np.int32), mu, kernel_array(quat, mu.dtype),
          kernel_array(log_scale, mu.dtype), *out)
    return out


def unbind(frames: FaceFrames, face: np.ndarray, bound: Bound) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The inverse of `bind`. face: (N,) int. Returns mu (N, 3), quat (N, 4) wxyz and log_scale (N, 3), float32."""
    R, T, k = frames.R[face], frames.T[face], np.maximum(frames.k[face, None], 1e-9)
    mu = np.einsum("nji,nj->ni", R, bound.means - T) / k
    quat = nearest_quaternions(np.einsum("nji,njk->nik", R, bound.rotations))
    log_scale = np.log(np.maximum(bound.scales, 1e-9) / k)
    return mu.astype(np.float32), quat.astype(np.float32), log_scale.astype(np.float32)


def bind_backward(vertices: np.ndarray, faces: np.ndarray, face: np.ndarray, mu: np.ndarray, quat: np.ndarray,
                  log_scale: np.ndarray, grad_means: np.ndarray, grad_rotations: np.ndarray,
                  grad_scales: np.ndarray) -> BindingGradients:
    """Gradient of `bind(face_frames(vertices, faces), face, mu, quat, log_scale)`.

    vertices: (V, 3) m; faces: (F, 3) int; face: (N,) int; mu: (N, 3); quat: (N, 4) wxyz; log_scale: (N, 3); grad_means: (N, 3),
    grad_rotations: (N, 3, 3), grad_scales: (N, 3): gradients with respect to the result of `bind`.
    """
    vertices = kernel_array(vertices)
    real = vertices.dtype
    mu = kernel_array(mu, real)
    out = BindingGradients(np.empty_like(mu), np.empty((len(mu), 4), real), np.empty_like(mu), np.empty_like(vertices))
    faces, face = kernel_array(faces, np.int32), kernel_array(face, np.int32)
    quat, log_scale, grad_means, grad_rotations, grad_scales = (
        kernel_array(a, real) for a in (quat, log_scale, grad_means, grad_rotations, grad_scales))
    backward(Workspace(1).share, vertices, faces, face, mu, quat, log_scale, grad_means, grad_rotations, grad_scales,
             np.empty((len(mu), 9), real), out)
    return out


def kernel_array(array: np.ndarray, dtype: DTypeLike = None) -> np.ndarray:
    """The array (...) as kernels take it: C order, writeable, float32 unless it is float64 or a dtype is given."""
    if dtype is None:
        dtype = np.float64 if np.asarray(array).dtype == np.float64 else np.float32
    return np.require(array, dtype, ["C", "W"])


def forward(share: Share, vertices: np.ndarray, faces: np.ndarray, used: np.ndarray, frames: FaceFrames, face: np.ndarray,
            mu: np.ndarray, quat: np.ndarray, log_scale: np.ndarray, out: Bound) -> None:
    """Frames of the faces that carry gaussians, then `bind`, into the buffers `frames` and `out`.

    share: `Workspace.share`; vertices: (V, 3) m; faces: (F, 3) int32; used: (F,) bool scratch; face: (N,) int32; mu: (N, 3);
    quat: (N, 4) wxyz; log_scale: (N, 3).
    """
    _used_frames(vertices, faces, face, used, *frames)
    share(_bind, frames.R, frames.T, frames.k, face, mu, quat, log_scale, *out)


def backward(share: Share, vertices: np.ndarray, faces: np.ndarray, face: np.ndarray, mu: np.ndarray, quat: np.ndarray,
             log_scale: np.ndarray, grad_means: np.ndarray, grad_rotations: np.ndarray, grad_scales: np.ndarray,
             corners: np.ndarray, out: BindingGradients) -> None:
    """As `bind_backward`, into the buffer `out`.

    share: `Workspace.share`; vertices: (V, 3) m; faces: (F, 3) int32; face: (N,) int32; mu: (N, 3); quat: (N, 4) wxyz;
    log_scale: (N, 3); grad_means: (N, 3); grad_rotations: (N, 3, 3); grad_scales: (N, 3); corners: (N, 9) scratch.
    """
    share(_bind_backward, vertices, faces, face, mu, quat, log_scale, grad_means, grad_rotations, grad_scales,
          out.mu, out.quat, out.log_scale, corners)
    _scatter(faces, face, corners, out.vertices)


@kernel
def _cross(a0, a1, a2, b0, b1, b2):
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@kernel
def _edges(vertices, faces, f):
    """v2 - v1, v0 - v1, their cross product, |v2 - v1|, |cross|, |v0 - v2|, and whether the face has an area."""
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    p0, p1, p2 = vertices[k, 0] - vertices[j, 0], vertices[k, 1] - vertices[j, 1], vertices[k, 2] - vertices[j, 2]
    q0, q1, q2 = vertices[i, 0] - vertices[j, 0], vertices[i, 1] - vertices[j, 1], vertices[i, 2] - vertices[j, 2]
    c0, c1, c2 = _cross(p0, p1, p2, q0, q1, q2)
    d0, d1, d2 = q0 - p0, q1 - p1, q2 - p2
    pp, qq = p0 * p0 + p1 * p1 + p2 * p2, q0 * q0 + q1 * q1 + q2 * q2
    area2 = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    real = vertices.dtype.type
    valid = area2 > real(1e-6) * (pp + qq) and area2 > real(1e-15)
    return (p0, p1, p2, q0, q1, q2, c0, c1, c2, d0, d1, d2, np.sqrt(pp), area2, np.sqrt(d0 * d0 + d1 * d1 + d2 * d2), valid)


@kernel
def _frame(vertices, faces, f, R, T, k, valid):
    real = vertices.dtype.type
    p0, p1, p2, _, _, _, c0, c1, c2, _, _, _, width, area2, side, good = _edges(vertices, faces, f)
    third = real(1 / 3)
    for axis in range(3):
        T[f, axis] = (vertices[faces[f, 0], axis] + vertices[faces[f, 1], axis] + vertices[faces[f, 2], axis]) * third
    valid[f] = good
    if good:
        a0, a1, a2 = p0 / width, p1 / width, p2 / width
        n0, n1, n2 = c0 / area2, c1 / area2, c2 / area2
        b0, b1, b2 = _cross(a0, a1, a2, n0, n1, n2)
        R[f, 0, 0], R[f, 0, 1], R[f, 0, 2] = a0, n0, b0
        R[f, 1, 0], R[f, 1, 1], R[f, 1, 2] = a1, n1, b1
        R[f, 2, 0], R[f, 2, 1], R[f, 2, 2] = a2, n2, b2
        k[f] = real(10) * (area2 / side + side)
    else:
        for i in range(3):
            for j in range(3):
                R[f, i, j] = real(1 if i == j else 0)
        k[f] = real(0)


@kernel
def _all_frames(vertices, faces, R, T, k, valid):
    for f in range(len(faces)):
        _frame(vertices, faces, f, R, T, k, valid)


@kernel
def _used_frames(vertices, faces, face, used, R, T, k, valid):
    used[:] = False
    for i in range(len(face)):
        if not used[face[i]]:
            used[face[i]] = True
            _frame(vertices, faces, np.int64(face[i]), R, T, k, valid)


@kernel
def _rotation(quat, i):
    """Rotation matrix row by row, the unit quaternion and the length; a zero quaternion gives no rotation, length 0."""
    real = quat.dtype.type
    w, x, y, z = quat[i, 0], quat[i, 1], quat[i, 2], quat[i, 3]
    length = np.sqrt(w * w + x * x + y * y + z * z)
    if length > real(1e-12):
        w, x, y, z = w / length, x / length, y / length, z / length
    else:
        length = real(0)
        w, x, y, z = real(1), real(0), real(0), real(0)
    one, two = real(1), real(2)
    return (one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y),
            two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x),
            two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y), w, x, y, z, length)


@kernel
def _bind(worker, workers, R, T, k, face, mu, quat, log_scale, means, rotations, scales):
    count = len(face)
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        f = face[i]
        r00, r01, r02, r10, r11, r12, r20, r21, r22, _, _, _, _, _ = _rotation(quat, i)
        for row in range(3):
            x, y, z = R[f, row, 0], R[f, row, 1], R[f, row, 2]
            means[i, row] = k[f] * (x * mu[i, 0] + y * mu[i, 1] + z * mu[i, 2]) + T[f, row]
            rotations[i, row, 0] = x * r00 + y * r10 + z * r20
            rotations[i, row, 1] = x * r01 + y * r11 + z * r21
            rotations[i, row, 2] = x * r02 + y * r12 + z * r22
            scales[i, row] = k[f] * np.exp(log_scale[i, row])


@kernel
def _bind_backward(worker, workers, vertices, faces, face, mu, quat, log_scale, grad_means, grad_rotations, grad_scales,
                   grad_mu, grad_quat, grad_log_scale, corners):
    count = len(face)
    real = vertices.dtype.type
    one, two, third = real(1), real(2), real(1 / 3)
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        p0, p1, p2, q0, q1, q2, c0, c1, c2, d0, d1, d2, width, area2, side, good = _edges(vertices, faces, np.int64(face[i]))
        r00, r01, r02, r10, r11, r12, r20, r21, r22, w, x, y, z, length = _rotation(quat, i)
        m0, m1, m2 = mu[i, 0], mu[i, 1], mu[i, 2]
        g0, g1, g2 = grad_means[i, 0], grad_means[i, 1], grad_means[i, 2]
        if good:
            a0, a1, a2 = p0 / width, p1 / width, p2 / width
            n0, n1, n2 = c0 / area2, c1 / area2, c2 / area2
            b0, b1, b2 = _cross(a0, a1, a2, n0, n1, n2)
            height = area2 / side
            k = real(10) * (height + side)
        else:
            a0, a1, a2 = one, real(0), real(0)
            n0, n1, n2 = real(0), one, real(0)
            b0, b1, b2 = real(0), real(0), one
            height = real(0)
            k = real(0)

        u0, u1, u2 = a0 * g0 + a1 * g1 + a2 * g2, n0 * g0 + n1 * g1 + n2 * g2, b0 * g0 + b1 * g1 + b2 * g2
        grad_mu[i, 0], grad_mu[i, 1], grad_mu[i, 2] = k * u0, k * u1, k * u2
        gk = m0 * u0 + m1 * u1 + m2 * u2
        for axis in range(3):
            s = np.exp(log_scale[i, axis])
            gk += grad_scales[i, axis] * s
            grad_log_scale[i, axis] = grad_scales[i, axis] * s * k

        G = grad_rotations[i]
        # local rotation: R^T G, then through the unit quaternion and its length
        t00, t01, t02 = (a0 * G[0, 0] + a1 * G[1, 0] + a2 * G[2, 0], a0 * G[0, 1] + a1 * G[1, 1] + a2 * G[2, 1],
                         a0 * G[0, 2] + a1 * G[1, 2] + a2 * G[2, 2])
        t10, t11, t12 = (n0 * G[0, 0] + n1 * G[1, 0] + n2 * G[2, 0], n0 * G[0, 1] + n1 * G[1, 1] + n2 * G[2, 1],
                         n0 * G[0, 2] + n1 * G[1, 2] + n2 * G[2, 2])
        t20, t21, t22 = (b0 * G[0, 0] + b1 * G[1, 0] + b2 * G[2, 0], b0 * G[0, 1] + b1 * G[1, 1] + b2 * G[2, 1],
                         b0 * G[0, 2] + b1 * G[1, 2] + b2 * G[2, 2])
        if length > real(0):
            gw = two * (x * (t21 - t12) + y * (t02 - t20) + z * (t10 - t01))
            gx = two * (w * (t21 - t12) + y * (t01 + t10) + z * (t02 + t20) - two * x * (t11 + t22))
            gy = two * (w * (t02 - t20) + x * (t01 + t10) + z * (t12 + t21) - two * y * (t00 + t22))
            gz = two * (w * (t10 - t01) + x * (t02 + t20) + y * (t12 + t21) - two * z * (t00 + t11))
            along = gw * w + gx * x + gy * y + gz * z
            grad_quat[i, 0], grad_quat[i, 1] = (gw - along * w) / length, (gx - along * x) / length
            grad_quat[i, 2], grad_quat[i, 3] = (gy - along * y) / length, (gz - along * z) / length
        else:
            grad_quat[i, :] = real(0)

        t0, t1, t2 = g0 * third, g1 * third, g2 * third
        if not good:
            for corner in range(3):
                corners[i, 3 * corner], corners[i, 3 * corner + 1], corners[i, 3 * corner + 2] = t0, t1, t2
            continue
        # the face's axes: G r^T + k g mu^T, column by column
        k0, k1, k2 = k * m0, k * m1, k * m2
        A0 = G[0, 0] * r00 + G[0, 1] * r01 + G[0, 2] * r02 + g0 * k0
        A1 = G[1, 0] * r00 + G[1, 1] * r01 + G[1, 2] * r02 + g1 * k0
        A2 = G[2, 0] * r00 + G[2, 1] * r01 + G[2, 2] * r02 + g2 * k0
        N0 = G[0, 0] * r10 + G[0, 1] * r11 + G[0, 2] * r12 + g0 * k1
        N1 = G[1, 0] * r10 + G[1, 1] * r11 + G[1, 2] * r12 + g1 * k1
        N2 = G[2, 0] * r10 + G[2, 1] * r11 + G[2, 2] * r12 + g2 * k1
        B0 = G[0, 0] * r20 + G[0, 1] * r21 + G[0, 2] * r22 + g0 * k2
        B1 = G[1, 0] * r20 + G[1, 1] * r21 + G[1, 2] * r22 + g1 * k2
        B2 = G[2, 0] * r20 + G[2, 1] * r21 + G[2, 2] * r22 + g2 * k2
        # b = a x n
        h0, h1, h2 = _cross(n0, n1, n2, B0, B1, B2)
        A0, A1, A2 = A0 + h0, A1 + h1, A2 + h2
        h0, h1, h2 = _cross(B0, B1, B2, a0, a1, a2)
        N0, N1, N2 = N0 + h0, N1 + h1, N2 + h2
        # n = c / |c| and k = 10 (|c| / L + L)
        gk *= real(10)
        along = n0 * N0 + n1 * N1 + n2 * N2
        C0 = (N0 - along * n0) / area2 + gk / side * n0
        C1 = (N1 - along * n1) / area2 + gk / side * n1
        C2 = (N2 - along * n2) / area2 + gk / side * n2
        gd = gk * (one - height / side) / side
        D0, D1, D2 = gd * d0, gd * d1, gd * d2
        # a = p / |p|, c = p x q, d = q - p
        along = a0 * A0 + a1 * A1 + a2 * A2
        h0, h1, h2 = _cross(q0, q1, q2, C0, C1, C2)
        P0 = (A0 - along * a0) / width + h0 - D0
        P1 = (A1 - along * a1) / width + h1 - D1
        P2 = (A2 - along * a2) / width + h2 - D2
        h0, h1, h2 = _cross(C0, C1, C2, p0, p1, p2)
        Q0, Q1, Q2 = h0 + D0, h1 + D1, h2 + D2
        corners[i, 0], corners[i, 1], corners[i, 2] = Q0 + t0, Q1 + t1, Q2 + t2
        corners[i, 3], corners[i, 4], corners[i, 5] = t0 - P0 - Q0, t1 - P1 - Q1, t2 - P2 - Q2
        corners[i, 6], corners[i, 7], corners[i, 8] = P0 + t0, P1 + t1, P2 + t2


@kernel
def _scatter(faces, face, corners, grad_vertices):
    """Sums the corners' gradients; one thread, so the order of the sum is fixed."""
    grad_vertices[:] = 0
    for i in range(len(face)):
        for corner in range(3):
            v = faces[face[i], corner]
            for axis in range(3):
                grad_vertices[v, axis] += corners[i, 3 * corner + axis]
