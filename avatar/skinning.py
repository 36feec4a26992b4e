"""Linear blend skinning: forward and hand-written backward (numba, float32 and float64).

J joints, V vertices, K influences a vertex, T poses. Rotations are axis-angle, radians. Parents come before children.
"""

from __future__ import annotations

import math

import numpy as np

from gsac.avatar.numba_kernel import own_kernel


def joint_transforms(pose: np.ndarray, joints: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """Rest-to-posed transforms of the joints.

    pose: (T, J, 3) axis-angle or (T, J, 3, 3) rotation matrices, relative to the parent; joints: (J, 3) rest, m;
    parents: (J,) int, -1 at the root, which turns about its own rest place. Returns (T, J, 3, 4): posed = A [rest; 1].
    """
    local = rotation_matrices(pose) if pose.ndim == 3 else np.ascontiguousarray(pose)
    transforms = np.empty((*local.shape[:2], 3, 4), local.dtype)
    _chain(local, np.ascontiguousarray(joints, local.dtype), np.ascontiguousarray(parents, np.int64), transforms)
    return transforms


def rotation_matrices(pose: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of pose (..., 3), axis-angle, in the same dtype."""
    flat = np.ascontiguousarray(pose).reshape(-1, 3)
    out = np.empty((len(flat), 3, 3), flat.dtype)
    _rodrigues(flat, out)
    return out.reshape(*pose.shape[:-1], 3, 3)


def rotation_matrices_backward(pose: np.ndarray, grad: np.ndarray) -> np.ndarray:
    """Gradient (J, 3) of pose (J, 3), axis-angle, from that of its rotation matrices, grad (J, 3, 3); float64."""
    out = np.empty(pose.shape)
    _rodrigues_backward(np.ascontiguousarray(pose, np.float64), np.ascontiguousarray(grad, np.float64), out)
    return out


def skin(rest: np.ndarray, transforms: np.ndarray, skin_index: np.ndarray, skin_weight: np.ndarray) -> np.ndarray:
    """Vertices (V, 3) of a posed mesh, without transl. rest: (V, 3); transforms: (J, 3, 4); skin_index, skin_weight: (V, K)."""
    out = np.empty_like(rest, order="C")
    _skin(rest, transforms, skin_index, skin_weight, out)
    return out


def skin_backward(grad: np.ndarray, pose: np.ndarray, rest: np.ndarray, joints: np.ndarray, parents: np.ndarray,
                  skin_index: np.ndarray, skin_weight: np.ndarray,
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Gradients of a loss through `skin(rest, joint_transforms(pose), ...) + transl`.

    grad: (V, 3) dLoss/dvertices; pose: (J, 3) axis-angle; rest: (V, 3); joints: (J, 3); parents: (J,);
    skin_index, skin_weight: (V, K). Returns the gradients of pose (J, 3), transl (3,), rest (V, 3) and joints (J, 3); the last two
    project on shape and expression bases.
    """
    pose64 = np.ascontiguousarray(pose, np.float64)
    joints64 = np.ascontiguousarray(joints, np.float64)
    parents = np.ascontiguousarray(parents, np.int64)
    local = rotation_matrices(pose64)
    transforms = joint_transforms(local[None], joints64, parents)[0]
    grad_rest = np.empty_like(rest, order="C")
    grad_transforms = np.zeros((len(parents), 3, 4))
    _skin_backward(np.ascontiguousarray(grad), rest, transforms.astype(rest.dtype), skin_index, skin_weight,
                   grad_rest, grad_transforms)
    grad_local = np.zeros_like(local)
    grad_joints = np.zeros_like(joints64)
    _chain_backward(local, joints64, parents, transforms, grad_transforms, grad_local, grad_joints)
    grad_pose = rotation_matrices_backward(pose64, grad_local)
    grad_transl = grad.sum(0, dtype=np.float64)
    return tuple(g.astype(rest.dtype) for g in (grad_pose, grad_transl, grad_rest, grad_joints))


@own_kernel(nogil=True, error_model="numpy")
def _coefficients(t2):
    """sin t / t, (1 - cos t) / t^2 and the derivative of each by t, divided by t."""
    if t2 < 1e-4:
        return 1 - t2 / 6 + t2 * t2 / 120, 0.5 - t2 / 24 + t2 * t2 / 720, -1 / 3 + t2 / 30, -1 / 12 + t2 / 180
    t = math.sqrt(t2)
    s, c = math.sin(t), math.cos(t)
    return s / t, (1 - c) / t2, (t * c - s) / (t2 * t), (t * s - 2 * (1 - c)) / (t2 * t2)


@own_kernel(nogil=True, error_model="numpy")
def _rodrigues(pose, out):
    for j in range(pose.shape[0]):
        x, y, z = np.float64(pose[j, 0]), np.float64(pose[j, 1]), np.float64(pose[j, 2])
        t2 = x * x + y * y + z * z
        a, b, _, _ = _coefficients(t2)
        out[j, 0, 0] = 1 + b * (x * x - t2)
        out[j, 1, 1] = 1 + b * (y * y - t2)
        out[j, 2, 2] = 1 + b * (z * z - t2)
        out[j, 0, 1] = b * x * y - a * z
        out[j, 1, 0] = b * x * y + a * z
        out[j, 0, 2] = b * x * z + a * y
        out[j, 2, 0] = b * x * z - a * y
        out[j, 1, 2] = b * y * z - a * x
        out[j, 2, 1] = b * y * z + a * x


@own_kernel(nogil=True, error_model="numpy")
def _rodrigues_backward(pose, grad, out):
    for j in range(pose.shape[0]):
        w, m = pose[j], grad[j]
        t2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        a, b, da, db = _coefficients(t2)
        trace = m[0, 0] + m[1, 1] + m[2, 2]
        skew = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
        on_k, on_k2 = 0.0, -t2 * trace  # <grad, K> and <grad, K^2>
        for i in range(3):
            on_k += w[i] * skew[i]
            for k in range(3):
                on_k2 += w[i] * m[i, k] * w[k]
        for i in range(3):
            turn = -2 * trace * w[i]
            for k in range(3):
                turn += (m[i, k] + m[k, i]) * w[k]
            out[j, i] = (da * on_k + db * on_k2) * w[i] + a * skew[i] + b * turn


@own_kernel(nogil=True, error_model="numpy")
def _chain(local, joints, parents, out):
    """out[..., :3] = world rotation, out[..., 3] = posed place of the joint minus its turned rest place."""
    for t in range(local.shape[0]):
        for j in range(len(parents)):
            p = parents[j]
            for i in range(3):
                for k in range(3):
                    if p < 0:
                        out[t, j, i, k] = local[t, j, i, k]
                    else:
                        out[t, j, i, k] = (out[t, p, i, 0] * local[t, j, 0, k] + out[t, p, i, 1] * local[t, j, 1, k]
                                           + out[t, p, i, 2] * local[t, j, 2, k])
            for i in range(3):
                place = joints[j, i]
                if p >= 0:
                    place = (out[t, p, i, 0] * joints[j, 0] + out[t, p, i, 1] * joints[j, 1]
                             + out[t, p, i, 2] * joints[j, 2] + out[t, p, i, 3])
                out[t, j, i, 3] = place - (out[t, j, i, 0] * joints[j, 0] + out[t, j, i, 1] * joints[j, 1]
                                           + out[t, j, i, 2] * joints[j, 2])


@own_kernel(nogil=True, error_model="numpy")
def _chain_backward(local, joints, parents, transforms, grad, grad_local, grad_joints):
    """A_j = [R_j | t_j - R_j J_j] with R_j = R_p L_j and t_j = A_p [J_j; 1]; grad is used up on its way up."""
    for j in range(len(parents) - 1, -1, -1):
        p = parents[j]
        for i in range(3):
            for k in range(3):
                grad_joints[j, k] -= transforms[j, i, k] * grad[j, i, 3]
                grad[j, i, k] -= grad[j, i, 3] * joints[j, k]
        if p < 0:
            for i in range(3):
                grad_joints[j, i] += grad[j, i, 3]
                for k in range(3):
                    grad_local[j, i, k] = grad[j, i, k]
            continue
        for i in range(3):
            grad[p, i, 3] += grad[j, i, 3]
            for k in range(3):
                grad_joints[j, k] += transforms[p, i, k] * grad[j, i, 3]
                grad_local[j, i, k] = (transforms[p, 0, i] * grad[j, 0, k] + transforms[p, 1, i] * grad[j, 1, k]
                                       + transforms[p, 2, i] * grad[j, 2, k])
                grad[p, i, k] += (grad[j, i, 3] * joints[j, k] + grad[j, i, 0] * local[j, k, 0]
                                  + grad[j, i, 1] * local[j, k, 1] + grad[j, i, 2] * local[j, k, 2])


@own_kernel(nogil=True, error_model="numpy")
def _skin(rest, transforms, skin_index, skin_weight, out):
    for v in range(rest.shape[0]):
        x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
        px, py, pz = x * 0, x * 0, x * 0
        for k in range(skin_index.shape[1]):
            w = skin_weight[v, k]
            if w != 0:
                a = transforms[skin_index[v, k]]
                px += w * (a[0, 0] * x + a[0, 1] * y + a[0, 2] * z + a[0, 3])
                py += w * (a[1, 0] * x + a[1, 1] * y + a[1, 2] * z + a[1, 3])
                pz += w * (a[2, 0] * x + a[2, 1] * y + a[2, 2] * z + a[2, 3])
        out[v, 0], out[v, 1], out[v, 2] = px, py, pz


@own_kernel(nogil=True, error_model="numpy")
def _skin_backward(grad, rest, transforms, skin_index, skin_weight, grad_rest, grad_transforms):
    for v in range(rest.shape[0]):
        gx, gy, gz = grad[v, 0], grad[v, 1], grad[v, 2]
        x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
        rx, ry, rz = gx * 0, gx * 0, gx * 0
        if gx != 0 or gy != 0 or gz != 0:
            for k in range(skin_index.shape[1]):
                w = skin_weight[v, k]
                if w != 0:
                    j = skin_index[v, k]
                    a, d = transforms[j], grad_transforms[j]
                    wx, wy, wz = w * gx, w * gy, w * gz
                    rx += a[0, 0] * wx + a[1, 0] * wy + a[2, 0] * wz
                    ry += a[0, 1] * wx + a[1, 1] * wy + a[2, 1] * wz
                    rz += a[0, 2] * wx + a[1, 2] * wy + a[2, 2] * wz
                    d[0, 0] += wx * x
                    d[0, 1] += wx * y
                    d[0, 2] += wx * z
                    d[0, 3] += wx
                    d[1, 0] += wy * x
                    d[1, 1] += wy * y
                    d[1, 2] += wy * z
                    d[1, 3] += wy
                    d[2, 0] += wz * x
                    d[2, 1] += wz * y
                    d[2, 2] += wz * z
                    d[2, 3] += wz
        grad_rest[v, 0], grad_rest[v, 1], grad_rest[v, 2] = rx, ry, rz
