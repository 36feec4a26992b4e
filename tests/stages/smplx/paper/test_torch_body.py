"""Skeleton, points and vertices in torch against the body model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.stages.smplx.paper.torch_body import Kinematics, Mesh, Points, to_matrices, to_six, to_vectors
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


def test_points_and_vertices_are_bent_by_the_correctives_of_a_body_that_has_them(official_body):
    body, rng = official_body.leading(20), np.random.default_rng(3)
    params = BodyParams.from_pose(rng.normal(0, 0.7, (3, 55, 3)), np.zeros((3, 3)), rng.normal(0, 1, 20), np.zeros((3, 100)), 500.0,
                                  (0, 0))
    vertices = body.posed(params)[0]
    known = np.flatnonzero(body.known_keypoints)
    betas, local = torch.tensor(params.betas), torch.tensor(rotation.exp(params.pose.astype(np.float64)), dtype=torch.float32)
    local.requires_grad_()
    kinematics = Kinematics(body)
    rest = kinematics.joints(betas, torch.zeros(55, 3))
    world, place = kinematics.pose(local, rest)
    found = Mesh(body).at(world, place, rest, betas)
    points = Points(body, body.keypoint_matrix[known]).at(world, place, rest, betas)
    np.testing.assert_allclose(found.detach().numpy().transpose(0, 2, 1), vertices, atol=2e-5)
    np.testing.assert_allclose(points.detach().numpy(), body.keypoints(vertices)[:, known], atol=2e-5)
    plain = replace(body, posedirs=None)
    assert np.abs(body.keypoints(plain.posed(params)[0]) - body.keypoints(vertices))[:, known].max() > 5e-3
    assert torch.autograd.grad(points.sum(), local)[0].isfinite().all()
