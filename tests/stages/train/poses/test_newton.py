"""Newton steps: they end at the minimum however steep the loss is, and no pose goes far by one of them."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.joints import BODY
from gsac.stages.train.poses.newton import MOST, SHARE, NewtonSteps
from gsac.stages.train.poses.photometric import UNKNOWNS
from gsac.stages.train.poses.poses import Poses
from support.train_task import task_of


def walk(steeper, number, noise=0.0):
    """Distances from the minimum of a loss that is `steeper` than the Hessian tells, after each of the steps."""
    steps, x, out, rng = NewtonSteps(np.eye(3, dtype=np.float32)), np.full(3, 0.01), [], np.random.default_rng(0)
    for _ in range(number):
        x = x + steps.step(steeper * (x + noise * rng.normal(size=3)))
        out.append(float(np.abs(x).max()))
    return out


@pytest.mark.parametrize("steeper", [1, 2, 10, 40])
def test_a_frame_comes_to_its_minimum_however_steep_the_loss_is(steeper):
    assert walk(steeper, 40)[-1] < 0.05 * 0.01


def test_a_steady_gradient_is_followed_by_whole_shares():
    found = walk(1, 10)
    assert found[-1] == pytest.approx(0.01 * (1 - SHARE) ** 10, rel=1e-6)


def test_noise_makes_the_steps_small():
    calm, late = walk(2, 400, noise=0.01), slice(300, None)
    assert np.std(calm[late]) < 0.1 * 0.01


def test_a_pose_that_is_not_learned_takes_no_step(job):
    poses = task_of(job(frames=3)).poses
    poses.newton = {0: NewtonSteps(np.eye(UNKNOWNS, dtype=np.float32))}
    before = poses.copy()
    poses.step(0, np.ones((len(poses.body.v_template), 3)), 0.0, 0.0)
    np.testing.assert_array_equal(poses.pose, before.pose)
    np.testing.assert_array_equal(poses.transl, before.transl)


def test_no_step_goes_far_whatever_its_gradient(job):
    poses = task_of(job(frames=3)).poses
    poses.newton = {0: NewtonSteps(1e6 * np.eye(UNKNOWNS, dtype=np.float32))}
    before = poses.copy()
    poses.step(0, np.ones((len(poses.body.v_template), 3)), 1e-3, 0.0)
    turns = rotation.log(np.swapaxes(rotation.exp(before.pose[0, BODY]), 1, 2) @ rotation.exp(poses.pose[0, BODY]))
    assert 0.9 * MOST < np.abs(turns).max() <= MOST + 1e-6
    assert np.abs(poses.transl - before.transl).max() <= MOST + 1e-6


def test_a_checkpoint_keeps_them(job):
    task = task_of(job(frames=3))
    task.poses.newton = {2: NewtonSteps(np.eye(UNKNOWNS, dtype=np.float32), 0.1, np.ones(UNKNOWNS))}
    other = Poses(task.poses.body, task.poses.params)
    other.restore(task.poses.state())
    kept = other.newton[2]
    assert list(other.newton) == [2] and kept.share == 0.1
    np.testing.assert_array_equal(kept.inverse, np.eye(UNKNOWNS))
    np.testing.assert_array_equal(kept.last, np.ones(UNKNOWNS))
