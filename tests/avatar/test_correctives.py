"""Pose correctives: the publication's formula, and its gradient."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar.body import BodyParams
from gsac.avatar.correctives import move_rest, move_rest_backward
from gsac.avatar.joints import INDEX
from support.official_body import EXPRESSIONS, SHAPES, official_arrays, posed_as_written, strong_poses


def test_a_whole_file_poses_as_the_publications_formulae_say(official_body):
    rng, arrays = np.random.default_rng(1), official_arrays()
    betas, expression, pose = rng.normal(0, 1, SHAPES), rng.normal(0, 1, (3, EXPRESSIONS)), strong_poses(3)
    transl = rng.normal(0, 1, (3, 3))
    got = official_body.posed(BodyParams.from_pose(pose, transl, betas, expression, 500.0, (0, 0)))[0]
    want = [posed_as_written(arrays, betas, expression[t], pose[t], transl[t]) for t in range(3)]
    np.testing.assert_allclose(got, want, atol=2e-5)


def test_an_elbow_bends_the_surface_that_plain_skinning_leaves(official_body):
    pose = np.zeros((1, 55, 3))
    pose[0, INDEX["left_elbow"], 1] = -1.8
    moved = np.linalg.norm(move_rest(official_body.posedirs, pose[0]), axis=1)
    _, joints = official_body.rest(np.zeros(1))
    far = np.linalg.norm(official_body.v_template - joints[INDEX["left_elbow"]], axis=1) > 0.4
    assert moved.max() > 3e-3 and moved[far].max() < 1e-5
    turned = np.zeros((55, 3))
    turned[0] = [0.3, 2, 0.1]
    assert not move_rest(official_body.posedirs, turned).any(), "the root has none"


def test_the_gradient_agrees_with_central_differences(official_body):
    rng, pose = np.random.default_rng(2), strong_poses(1)[0]
    posedirs, grad = official_body.posedirs.astype(np.float64), rng.normal(size=official_body.v_template.shape)
    got = move_rest_backward(posedirs, pose, grad)
    for _ in range(6):
        step = rng.normal(size=pose.shape)
        slope = ((move_rest(posedirs, pose + 1e-5 * step) - move_rest(posedirs, pose - 1e-5 * step)) * grad).sum() / 2e-5
        assert (got * step).sum() == pytest.approx(slope, rel=1e-6)
