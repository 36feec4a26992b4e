"""Where a bent joint makes faces grow, gaussians are many, small and tied to their place; elsewhere nothing holds them."""

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.stages.train.fast.initial_gaussians import init_gaussians
from gsac.stages.train.fast.schedule import longest_axis
from gsac.stages.train.fast.trainer import Step, Trainer
from gsac.stages.train.gaussians.joint_faces import face_weights
from gsac.stages.train.gaussians.joint_limits import LEAST_SHARE, MOST_DENSE, SPREAD, TIE, density_where_grown, limit_where_grown
from gsac.stages.train.views import person_crop
from support.train_task import task_of

COUNT = 3000


@pytest.fixture
def task(job):
    """A short clip of a person with hanging arms."""
    return task_of(job(), held=(3, 8))


@pytest.fixture
def started(task):
    """The task's gaussians, and its views at half the size."""
    views = {int(t): person_crop(task.views[t]).halved() for t in task.trained}
    return init_gaussians(task, views, COUNT), views


def faces_of(task, joint, share=0.9):
    """(F,) bool, faces that hang on one joint nearly alone."""
    return face_weights(task.poses.body)[:, task.poses.body.joint_names.index(joint)] > share


def test_faces_of_armpits_and_knees_grow_and_those_of_the_head_and_of_the_middle_of_a_limb_do_not(task):
    growth = task.growth
    assert growth.min() == 1
    for rigid in ("head", "left_elbow", "right_knee"):
        assert np.median(growth[faces_of(task, rigid)]) < 1.02
    weights = face_weights(task.poses.body)
    names = task.poses.body.joint_names
    for one, other in (("left_shoulder", "left_collar"), ("right_hip", "right_knee")):
        shared = np.minimum(weights[:, names.index(one)], weights[:, names.index(other)]) > 0.3
        assert growth[shared].max() > 1.3


def test_what_training_does_to_the_poses_does_not_change_the_growth(task):
    before = task.growth
    task.poses.pose[:] += 0.1
    del task.__dict__["growth"]
    np.testing.assert_array_equal(task.growth, before)


def test_a_resumed_training_has_the_limits_that_it_began_with(task, started):
    state = Trainer(started[0], task).state()
    task.growth = np.ones_like(task.growth)
    resumed = Trainer.from_state(state, task)
    assert resumed.tied.any()
    np.testing.assert_array_equal(resumed.tied, state["tied"])
    np.testing.assert_array_equal(resumed.largest, state["largest"])


def test_the_more_a_face_grows_the_more_and_the_smaller_gaussians_it_has_within_bounds():
    growth, longest = np.array([1.0, 1.05, 1.3, 1.6, 3.0]), 0.025
    np.testing.assert_allclose(density_where_grown(growth), [1, 1.05**2, 1.3**2, 1.6**2, MOST_DENSE])
    limits = limit_where_grown(growth, longest)
    np.testing.assert_allclose(limits.longest, [longest, longest, SPREAD / 0.3, SPREAD / 0.6, LEAST_SHARE * longest])
    assert limits.tied.tolist() == [False, False, True, True, True]


def test_a_trained_gaussian_on_a_face_that_grows_is_small_flat_and_near_its_start_and_others_are_free(task, started):
    gaussians, views = started
    trainer = Trainer(gaussians, task)
    for step, t in enumerate(np.tile(task.trained, 3)):
        trainer.learn([Step(int(t), views[int(t)], 0.1, np.ones(3), step)])
    made, at = trainer.gaussians(), face_frames(trainer.rest, trainer.faces)
    scales = bind(at, made.face, made.mu, made.quat, made.log_scale).scales
    tied = (task.growth > 1.08)[made.face]
    moved = np.linalg.norm(made.mu - trainer.start, axis=1) * at.k[made.face]
    assert 0.1 < tied.mean() < 0.5
    assert moved[tied].max() <= TIE * 1.001 < moved[~tied].max()
    assert not made.quat[tied][:, [1, 3]].any() and np.abs(made.quat[~tied][:, [1, 3]]).max() > 0.01
    limits = limit_where_grown(task.growth, longest_axis(task.config, COUNT)).longest[made.face]
    assert (scales.max(1) <= np.maximum(limits, trainer.least) * 1.001).all()


def test_gaussians_of_a_frozen_body_which_span_several_faces_are_free(task, started):
    trainer = Trainer(started[0], task, frozen_body=True)
    assert not trainer.tied.any() and (trainer.largest == longest_axis(task.config, COUNT)).all()
