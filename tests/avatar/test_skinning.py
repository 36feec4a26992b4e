"""Skinning against plain 4x4 algebra, and its backward against central differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.skinning import joint_transforms, rotation_matrices, skin, skin_backward

PARENTS = np.array([-1, 0, 0, 1, 1, 3, 2], np.int64)


def scene(seed=0, vertices=60, dtype=np.float64):
    rng = np.random.default_rng(seed)
    joints = rng.normal(0, 0.5, (len(PARENTS), 3))
    pose = rng.normal(0, 0.9, (len(PARENTS), 3))
    pose[2] = 0
    pose[3] *= 1e-4
    pose[0] = (np.pi - 1e-3, 0.01, 0)
    rest = rng.normal(0, 1, (vertices, 3))
    index = rng.integers(0, len(PARENTS), (vertices, 4)).astype(np.int32)
    weight = rng.random((vertices, 4))
    weight[::3, 2:] = 0
    weight /= weight.sum(1, keepdims=True)
    return [a.astype(dtype) for a in (pose, rest, joints)], index, weight.astype(dtype)


def test_rotations_agree_with_scipy():
    pose = np.random.default_rng(1).normal(0, 2, (50, 3))
    pose[0] = 0
    np.testing.assert_allclose(rotation_matrices(pose), Rotation.from_rotvec(pose).as_matrix(), atol=1e-13)


def test_skin_agrees_with_homogeneous_matrices():
    (pose, rest, joints), index, weight = scene()
    local = np.tile(np.eye(4), (len(PARENTS), 1, 1))
    local[:, :3, :3] = Rotation.from_rotvec(pose).as_matrix()
    local[:, :3, 3] = joints - np.where(PARENTS[:, None] >= 0, joints[PARENTS], 0)
    world = np.empty_like(local)
    for j, p in enumerate(PARENTS):
        world[j] = local[j] if p < 0 else world[p] @ local[j]
    posed_joints = world[:, :3, 3].copy()
    world[:, :3, 3] -= np.einsum("jab,jb->ja", world[:, :3, :3], joints)
    homogeneous = np.concatenate([rest, np.ones((len(rest), 1))], 1)
    want = np.einsum("vk,vkab,vb->va", weight, world[index][:, :, :3], homogeneous)
    transforms = joint_transforms(pose[None], joints, PARENTS)[0]
    np.testing.assert_allclose(skin(rest, transforms, index, weight), want, atol=1e-12)
    np.testing.assert_allclose(np.einsum("jab,jb->ja", transforms[:, :, :3], joints) + transforms[:, :, 3],
                               posed_joints, atol=1e-12)


def test_zero_pose_leaves_the_rest_vertices():
    (_, rest, joints), index, weight = scene()
    transforms = joint_transforms(np.zeros((1, len(PARENTS), 3)), joints, PARENTS)[0]
    np.testing.assert_allclose(skin(rest, transforms, index, weight), rest, atol=1e-13)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_backward_agrees_with_central_differences(seed):
    (pose, rest, joints), index, weight = scene(seed)
    v = np.random.default_rng(seed + 9).normal(size=rest.shape)

    def loss(pose, rest, joints):
        return float((skin(rest, joint_transforms(pose[None], joints, PARENTS)[0], index, weight) * v).sum())

    grad_pose, grad_transl, grad_rest, grad_joints = skin_backward(v, pose, rest, joints, PARENTS, index, weight)
    np.testing.assert_allclose(grad_transl, v.sum(0))
    values = [pose, rest, joints]
    for which, got in ((0, grad_pose), (1, grad_rest), (2, grad_joints)):
        want = np.empty_like(values[which])
        for i in np.ndindex(want.shape):
            step = np.zeros_like(want)
            step[i] = 1e-5
            args = [[a + s * step if n == which else a for n, a in enumerate(values)] for s in (1, -1)]
            want[i] = (loss(*args[0]) - loss(*args[1])) / 2e-5
        np.testing.assert_allclose(got, want, rtol=1e-6, atol=1e-7)


def test_float32_backward_stays_near_float64():
    (pose, rest, joints), index, weight = scene(3)
    v = np.random.default_rng(4).normal(size=rest.shape)
    want = skin_backward(v, pose, rest, joints, PARENTS, index, weight)
    (pose, rest, joints), index, weight = scene(3, dtype=np.float32)
    got = skin_backward(v.astype(np.float32), pose, rest, joints, PARENTS, index, weight)
    for a, b in zip(got, want, strict=True):
        assert a.dtype == np.float32
        np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-4 * np.abs(b).max())
