"""Where no frame shows the body from, training keeps its outline sharp; a clip that shows it all round is left as it is."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.avatar.yaw import yaw
from gsac.stages.train.fast.initial_gaussians import init_gaussians
from gsac.stages.train.fast.trainer import Room, Step, Trainer
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.unseen_sides import APART, BEGIN, EVERY, HIGHEST, LOOKED_AT, find_sides, side_at, turned_vertices
from gsac.stages.train.views import person_crop
from support.train_task import task_of

FRAMES = 36


@pytest.fixture
def task(job):
    return task_of(job(frames=FRAMES))


def yaws_of(task, sides):
    """(n,) rad, of the bodies of sides."""
    return yaw(np.stack([side.turn for side in sides]) @ rotation.exp(task.poses.fit_pose[[side.frame for side in sides], 0]))


def test_a_clip_that_shows_the_body_all_round_has_no_unseen_side(task):
    assert task.sides == []


def test_of_a_quarter_turn_all_sides_are_unseen_that_are_far_from_every_frame(task):
    task.trained = np.arange(FRAMES // 4)
    seen, found = yaw(rotation.exp(task.poses.fit_pose[task.trained, 0])), yaws_of(task, task.sides)
    apart = np.abs((found[:, None] - seen + np.pi) % (2 * np.pi) - np.pi)
    assert apart.min() > APART
    assert len(found) == len(np.unique(found.round(6))) > LOOKED_AT / 2
    assert {side.frame for side in task.sides} == set(task.trained.tolist())


def test_what_training_does_to_the_poses_changes_no_side(task):
    task.trained = np.arange(9)
    before = task.sides
    task.poses.pose[:] += 0.3
    after = find_sides(task.poses, task.trained, before[0].view.frame)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one.turn, other.turn)
        assert one.view.camera == other.view.camera


def test_a_side_is_the_frames_pose_with_another_turn_of_the_pelvis_and_its_view_holds_all_of_the_body(task):
    task.trained, poses = np.arange(9), task.poses
    for t, turn, view in task.sides:
        rest, joints = poses.rest(t)
        pose = poses.pose[t].copy()
        pose[0] = rotation.log(turn @ rotation.exp(pose[0]))
        vertices = turned_vertices(poses, t, turn)
        np.testing.assert_allclose(vertices, poses.body.bend(rest, joints, pose) + poses.transl[t], atol=2e-5)
        at = view.camera.project(vertices)
        assert (at >= 0).all() and (at <= [view.camera.width, view.camera.height]).all()
        assert not view.pixels.any() and view.pixels.shape[:2] == (view.camera.height, view.camera.width)


def test_a_body_that_would_be_turned_into_the_camera_is_not_looked_at(task):
    task.trained = np.arange(9)
    params = task.poses.params
    params.transl = params.transl * np.float32([1, 1, 0.03])
    assert find_sides(Poses(task.poses.body, params), task.trained, task.views[0].frame) == []


def test_of_somebody_near_whom_frames_show_in_part_no_side_is_larger_than_two_frames_and_it_shows_all_of_the_body(task):
    task.trained = np.arange(9)
    params, camera = task.poses.params, task.views[0].frame
    params.transl = params.transl * np.float32([1, 1, 0.22])
    poses = Poses(task.poses.body, params)
    sides = find_sides(poses, task.trained, camera)
    assert max(side.view.camera.height for side in sides) == HIGHEST * camera.height
    for t, turn, view in sides:
        at = view.camera.project(turned_vertices(poses, t, turn))
        assert (at >= 0).all() and (at <= [view.camera.width, view.camera.height]).all()
        assert view.pixels.shape[:2] == (view.camera.height, view.camera.width)


def test_every_third_step_late_in_a_training_is_made_on_a_side_each_in_its_turn():
    steps = 600
    found = [side_at(number, number / steps, 5) for number in range(steps)]
    assert all(at is None for at in found[:int(BEGIN * steps)])
    looks = [at for at in found if at is not None]
    assert len(looks) == pytest.approx((1 - BEGIN) * steps / EVERY, abs=1)
    assert set(looks) == set(range(5)) and max(looks.count(at) for at in range(5)) - min(looks.count(at) for at in range(5)) <= 1
    assert all(side_at(number, number / steps, 0) is None for number in range(steps))


def test_steps_on_sides_sharpen_the_outline_and_leave_colours_poses_gains_and_unseen_gaussians(task):
    task.trained, task.config.exposure = np.arange(9), True
    views = {int(t): person_crop(task.views[t]).halved() for t in task.trained}
    trainer = Trainer(init_gaussians(task, views, 900), task)
    trainer.learn([Step(0, views[0], 0.1, np.ones(3), 0)])
    rng = np.random.default_rng(0)
    trainer.values["log_scale"][:, 1] += rng.uniform(0, 2.5, len(trainer.face)).astype(np.float32)
    trainer.fold_offsets()
    trainer.seen = rng.random(len(trainer.face)) < 0.9

    def look(number):
        t, turn, view = task.sides[number % len(task.sides)]
        trainer.learn([Step(t, view, 0.7, np.ones(3), number, turn)])

    pose, transl, count = task.poses.pose.copy(), task.poses.transl.copy(), task.poses.count.copy()
    look(0)  # from here on no limit is left to be kept
    before, gains = trainer.gaussians(), dict(trainer.gains)

    def blur():
        """Alpha times what lacks of it, of all sides."""
        alphas = [render_bound(turned_vertices(task.poses, t, turn), trainer.faces, trainer.gaussians(), view.camera,
                               Workspace()).alpha for t, turn, view in task.sides]
        return sum(float((alpha * (1 - alpha)).sum()) for alpha in alphas)

    at_first = blur()
    for number in range(1, 120):
        look(number)
    after = trainer.gaussians()
    assert blur() < 0.8 * at_first
    np.testing.assert_array_equal(after.rgb, before.rgb)
    np.testing.assert_array_equal(after.log_scale[~trainer.seen], before.log_scale[~trainer.seen])
    np.testing.assert_array_equal(task.poses.pose, pose)
    np.testing.assert_array_equal(task.poses.transl, transl)
    np.testing.assert_array_equal(task.poses.count, count)
    assert trainer.gains.keys() == gains.keys() == {0}
    np.testing.assert_array_equal(trainer.gains[0], gains[0])


def test_the_gradient_of_an_outline_is_that_of_alphas_distance_from_its_own_half(task):
    task.trained = np.arange(9)
    views = {int(t): person_crop(task.views[t]).halved() for t in task.trained}
    trainer = Trainer(init_gaussians(task, views, 300), task)
    t, turn, view = task.sides[0]
    step = Step(t, view, 0.7, np.ones(3), 0, turn)
    found = trainer.gradients(step, Room.open())
    grad = found.values["opacity_logit"][:, 0].copy()
    at = int(np.argmax(np.abs(grad)))
    losses = []
    for sign in (1, -1):
        trainer.values["opacity_logit"][at] += np.float32(sign * 0.02)
        losses.append(trainer.gradients(step, Room.open()).loss)
        trainer.values["opacity_logit"][at] -= np.float32(sign * 0.02)
    assert grad[at] == pytest.approx((losses[0] - losses[1]) / 0.04, rel=0.1)
    assert found.loss == pytest.approx(trainer.gradients(step, Room.open()).loss)
