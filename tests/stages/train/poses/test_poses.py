"""What is learned of the body beside its poses: expression and the joints at rest, against finite differences and in a training."""

import json

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.stage import run


@pytest.fixture
def poses():
    body, rng = Body.load(), np.random.default_rng(2)
    pose = rng.normal(0, 0.3, (3, 55, 3))
    pose[:, 0] += [np.pi, 0, 0]
    expression = rng.random((3, body.exprdirs.shape[2])) * 0.3
    return Poses(body, BodyParams.from_pose(pose, rng.normal(size=(3, 3)), rng.normal(0, 0.3, 8), expression, 500.0, (0, 0),
                                            rng.normal(0, 0.01, (55, 3))))


def test_gradients_of_expression_and_joints_are_those_of_finite_differences(poses):
    weights = np.random.default_rng(5).normal(size=poses.vertices(1).shape)
    _, _, grad_rest, grad_joints = poses.gradients(1, weights)

    def slope(values, at, h):
        ends = []
        for sign in (1, -1):
            values[at] += sign * h
            poses.forget_expressions()
            ends.append(float((weights * poses.vertices(1)).sum(dtype=np.float64)))
            values[at] -= sign * h
        return (ends[0] - ends[1]) / (2 * h)

    by_expression = poses.expression_gradient(grad_rest)
    for values, places, gradient, h in ((poses.expression, [(1, k) for k in (0, 7, 25, 51)], by_expression[None].repeat(2, 0), 0.5),
                                        (poses.joint_offset, [(j, axis) for j in (1, 5, 12, 16, 20, 30) for axis in range(3)],
                                         grad_joints, 0.05)):
        measured, expected = (np.array([take(at) for at in places]) for take in (
            lambda at, values=values, h=h: slope(values, at, h), lambda at, gradient=gradient: gradient[at]))
        np.testing.assert_allclose(measured, expected, rtol=2e-3, atol=2e-3 * np.abs(expected).max())


def test_gradients_of_a_pose_count_what_the_correctives_move(official_body):
    rng = np.random.default_rng(6)
    poses = Poses(official_body, BodyParams.from_pose(rng.normal(0, 0.5, (1, 55, 3)), np.zeros((1, 3)), rng.normal(0, 1, 8),
                                                      np.zeros((1, 100)), 500.0, (0, 0)))
    poses.offset[:] = rng.normal(0, 2e-3, poses.offset.shape)
    weights = rng.normal(size=poses.offset.shape)
    told = poses.gradients(0, weights)[0]
    start = poses.pose[0].copy()

    def value(pose):
        poses.pose[0] = pose
        return float((weights * poses.vertices(0)).sum(dtype=np.float64))

    for _ in range(5):
        step = rng.normal(size=start.shape)
        slope = (value(start + 1e-3 * step) - value(start - 1e-3 * step)) / 2e-3
        assert (told * step).sum() == pytest.approx(slope, abs=2e-3 * np.linalg.norm(told) * np.linalg.norm(step))


def test_steps_lead_to_the_expression_and_the_joints_that_were_and_what_is_written_wears_them(poses):
    body, wanted = poses.body, poses.copy()
    wanted.expression, wanted.joint_offset = poses.expression.copy(), poses.joint_offset.copy()
    wanted.expression[1, 25], wanted.joint_offset[16, 1] = 0.5, 0.02
    wanted.forget_expressions()
    aim = wanted.vertices(1)
    before = np.abs(poses.vertices(1) - aim).mean()
    for _ in range(60):
        _, _, grad_rest, grad_joints = poses.gradients(1, poses.vertices(1) - aim)
        poses.wear_expression(1, poses.expression[1] - 1e-2 * np.sign(poses.expression_gradient(grad_rest)))
        poses.step_joints(grad_joints, 1e-3, 0.0)
    assert np.abs(poses.vertices(1) - aim).mean() < 0.2 * before
    assert not poses.expression[[0, 2]].any() and not poses.joint_offset[[0, 22, 23, 24]].any()
    written = poses.to_params()
    np.testing.assert_allclose(body.posed(written, [1])[0][0], poses.vertices(1), atol=2e-6)
    between = carry_to_untrained(poses, np.array([1, 2]))
    assert np.array_equal(between.expression[0], poses.expression[1]) and between.expression[1].any()


@pytest.mark.slow
def test_a_training_corrects_expressions_with_the_poses_and_learns_joints_where_it_is_asked_to(job_anywhere):
    plain, asked = (job_anywhere(name, steps=40, pose_test_steps=0, **rates) for name, rates in
                    (("plain", {"pose_rounds": 0, "pose_rate": 0.0}), ("asked", {"joint_rate": 1e-3})))
    for made in (plain, asked):
        run(made)
    fitted = BodyParams.read(plain.inputs["smplx/body.npz"])
    one, other = (BodyParams.read(made.out / "body.npz") for made in (plain, asked))
    assert np.array_equal(one.expression, fitted.expression)
    np.testing.assert_allclose(one.joint_offset, fitted.joint_offset, atol=1e-6)
    assert 1e-3 < np.abs(other.expression - fitted.expression).max() < 0.5
    assert 1e-4 < np.abs(other.joint_offset - fitted.joint_offset).max() < 0.05
    assert np.isfinite(json.loads((asked.out / "metrics.json").read_text())["psnr_fg"])
