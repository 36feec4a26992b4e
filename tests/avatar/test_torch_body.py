"""Skeleton, points and vertices in torch against the body model."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.torch_body import Kinematics, Mesh, Points, to_matrices, to_six, to_vectors
from support.turning_person import facing_person

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.load()


def test_six_numbers_and_rotations_say_the_same():
    turns = rotation.exp(np.random.default_rng(1).normal(0, 0.7, (20, 3)))
    tensor = torch.tensor(turns)
    torch.testing.assert_close(to_matrices(3 * to_six(tensor)), tensor)
    np.testing.assert_allclose(to_vectors(tensor).numpy(), rotation.log(turns), atol=1e-5)


def test_points_lie_where_the_posed_body_has_them(body):
    params = facing_person(body)
    params.joint_offset = np.random.default_rng(2).normal(0, 0.01, (55, 3)).astype(np.float32)
    vertices, joints = body.posed(params)
    known = np.flatnonzero(body.known_keypoints)
    chain, points = Kinematics(body), Points(body, body.keypoint_matrix[known])
    betas = torch.tensor(params.betas)
    rest = chain.joints(betas, torch.tensor(params.joint_offset))
    local = torch.tensor(rotation.exp(params.pose.astype(np.float64)), dtype=torch.float32)
    world, place = chain.pose(local, rest)
    transl = params.transl[:, None]
    np.testing.assert_allclose(place.numpy() + transl, joints, atol=1e-5)
    np.testing.assert_allclose(points.at(world, place, rest, betas).numpy() + transl, body.keypoints(vertices)[:, known], atol=1e-5)


def test_every_vertex_lies_where_the_posed_body_has_it(body):
    """The term that holds the mesh to the start looks at all of them."""
    params = facing_person(body)
    params.transl[:] = 0
    betas, local = torch.tensor(params.betas), torch.tensor(rotation.exp(params.pose.astype(np.float64)), dtype=torch.float32)
    kinematics = Kinematics(body)
    rest = kinematics.joints(betas, torch.zeros(55, 3))
    found = Mesh(body).at(*kinematics.pose(local, rest), rest, betas)
    np.testing.assert_allclose(found.numpy().transpose(0, 2, 1), body.posed(params)[0], atol=1e-5)
