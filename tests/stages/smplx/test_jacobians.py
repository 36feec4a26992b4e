"""Derivatives of a body's points whose pose correctives bend it, against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import BodyParams
from gsac.stages.smplx.jacobians import Skeleton, make_pairs, make_surface_pairs, place_points, pull_back
from gsac.stages.smplx.prior import BODY_JOINTS


def test_points_lie_where_the_bent_surface_has_them_and_move_as_told(official_body):
    body, rng = official_body.leading(12), np.random.default_rng(0)
    pose, betas = rng.normal(0, 0.6, (2, 55, 3)), rng.normal(0, 1, 12)
    known = np.flatnonzero(body.known_keypoints)
    pairs, skeleton = make_pairs(body, body.keypoint_matrix[known]), Skeleton(body, BODY_JOINTS)
    local = rotation.exp(pose)
    x = place_points(skeleton.pose(local, betas), pairs, betas)
    posed = body.posed(BodyParams.from_pose(pose, np.zeros((2, 3)), betas, np.zeros((2, 100)), 500.0, (0, 0)))[0]
    np.testing.assert_allclose(x, body.keypoints(posed)[:, known], atol=2e-4)
    covectors = np.broadcast_to(np.eye(3), (*x.shape[:2], 3, 3))
    rows = pull_back(skeleton, skeleton.pose(local, betas), pairs, betas, covectors)
    plain = pull_back(skeleton, skeleton.pose(local, betas), replace(pairs, moment_turns=None), betas, covectors)
    assert np.abs(rows - plain)[..., : 3 * len(BODY_JOINTS)].max() > 3e-3, "correctives have a part in the slopes"
    for _ in range(4):
        step, change = rng.normal(size=(2, len(BODY_JOINTS), 3)), rng.normal(size=12)
        ends = []
        for h in (1e-5, -1e-5):
            turned, shape = local.copy(), betas + h * change
            turned[:, BODY_JOINTS] = turned[:, BODY_JOINTS] @ rotation.exp(h * step)
            ends.append(place_points(skeleton.pose(turned, shape), pairs, shape))
        told = np.einsum("tprn,tn->tpr", rows, np.concatenate([step.reshape(2, -1), np.zeros((2, 3)), np.tile(change, (2, 1))], 1))
        np.testing.assert_allclose(told, (ends[0] - ends[1]) / 2e-5, atol=1e-6)


def test_points_of_the_outline_keep_the_correctives_of_the_pose_they_were_sampled_in(official_body):
    body, rng = official_body.leading(12), np.random.default_rng(1)
    pose, face = rng.normal(0, 0.6, (1, 55, 3)).astype(np.float32), np.arange(0, len(official_body.faces), 7)
    bary = rng.dirichlet(np.ones(3), len(face))
    pairs = make_surface_pairs(body, face, bary, pose[0])
    x = place_points(Skeleton(body, BODY_JOINTS).pose(rotation.exp(pose.astype(float)), np.zeros(12)), pairs, np.zeros(12))[0]
    posed = body.posed(BodyParams.from_pose(pose, np.zeros((1, 3)), np.zeros(12), np.zeros((1, 100)), 500.0, (0, 0)))[0][0]
    np.testing.assert_allclose(x, np.einsum("pk,pkc->pc", bary, posed[body.faces[face]]), atol=1e-5)


def test_unseen_fingers_rest_in_the_mean_hand_of_a_body_that_has_one(official_body):
    from gsac.stages.smplx.prior import FINGER_JOINTS, pose_prior

    np.testing.assert_array_equal(pose_prior(FINGER_JOINTS, official_body.hand_means)[0], official_body.hand_means)
    assert np.array_equal(pose_prior(BODY_JOINTS, official_body.hand_means)[0], pose_prior(BODY_JOINTS)[0])
