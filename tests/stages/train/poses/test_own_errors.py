"""Frames' own errors: each pose goes to its own image, and those between follow."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.joints import BODY
from gsac.stages.contract import StageError
from gsac.stages.train.fast.cpu import Cpu
from gsac.stages.train.fast.initial_gaussians import init_gaussians
from gsac.stages.train.fast.schedule import correction_steps
from gsac.stages.train.fast.trainer import Room, Step, Trainer
from gsac.stages.train.poses.newton import SHARE
from gsac.stages.train.poses.own_errors import SHIFT, correct_each, newton_steps
from gsac.stages.train.poses.photometric import UNKNOWNS, NormalEquations
from gsac.stages.train.views import person_crop
from support.train_task import TRUE_SHIFT, task_of

OFF = 0.004
"""m by which one frame stands off."""


def trained_avatar(task):
    """A trainer that has seen all trained frames in their true poses, and their views at half the size."""
    poses, views = task.poses, {int(t): person_crop(task.views[t]).halved() for t in task.trained}
    poses.transl[:, 0] -= TRUE_SHIFT
    poses.settle()
    trainer = Trainer(init_gaussians(task, views, 3000), task)
    trainer.pose_rate = 0.0
    for step, t in enumerate(np.tile(task.trained, 6)):
        trainer.learn([Step(int(t), views[int(t)], 0.3, np.ones(3), step)])
    return trainer, views


def test_a_frame_that_is_off_goes_back_by_itself_and_becomes_the_new_base(job):
    task = task_of(job(), held=(3, 8))
    trainer, views = trained_avatar(task)
    poses, at, ends = task.poses, int(task.trained[2]), []
    right = poses.copy()
    for off in (0, OFF):
        poses.pose[:], poses.transl[:] = right.pose, right.transl
        poses.transl[at, 0] += off
        with Cpu().open_equations(task, trainer.gaussians(), views) as equations:
            for _ in range(8):
                correct_each(poses, task.trained, trainer.gaussians, equations)
        ends.append(poses.transl[:, 0].copy())
    apart = np.abs(ends[1] - ends[0])
    assert apart[at] < 0.5 * OFF
    np.testing.assert_allclose(np.delete(apart, [at, 3, 8]), 0, atol=1e-3)
    np.testing.assert_array_equal(poses.base_transl, poses.transl)
    np.testing.assert_array_equal(poses.base_pose, poses.pose)


def test_frames_between_follow_and_what_an_image_does_not_tell_stays(job):
    task = task_of(job(), held=(3, 8))
    poses = task.poses
    before = poses.copy()

    def equations(gaussians):
        """Every image asks for 1 cm to the right, surely, and tells nothing else."""
        told = np.zeros((UNKNOWNS, UNKNOWNS))
        told[-3, -3] = 1e9
        return [(int(t), NormalEquations(told @ np.full(UNKNOWNS, -0.01), told, 1.0, 1000)) for t in task.trained]

    correct_each(poses, task.trained, lambda: None, equations)
    moved = poses.transl - before.transl
    assert moved[task.trained, 0] == pytest.approx(0.01, rel=0.01)
    assert moved[[3, 8], 0] == pytest.approx(0.01, rel=0.01), "frames between are carried along"
    np.testing.assert_allclose(moved[:, 1:], 0, atol=1e-9)
    np.testing.assert_allclose(rotation.exp(poses.pose[task.trained]), rotation.exp(before.pose[task.trained]), atol=1e-6)


def test_an_unsure_image_moves_a_frame_by_little(job):
    task = task_of(job(frames=3))
    before = task.poses.copy()

    def equations(gaussians):
        """Wishes for 10 cm, no surer than the step's own spread."""
        known, told = 1 / (1.0 / 4000 * 40), np.zeros((UNKNOWNS, UNKNOWNS))
        told[-3, -3] = SHIFT**-2 / known
        return [(0, NormalEquations(told @ np.full(UNKNOWNS, -0.1), told, 1.0, 1000))]

    correct_each(task.poses, task.trained, lambda: None, equations)
    assert task.poses.transl[0, 0] - before.transl[0, 0] == pytest.approx(0.05)


def test_a_step_of_the_training_takes_a_share_of_a_gauss_newton_step(job):
    task = task_of(job(ssim=0, mask=1 / 3), held=(3, 8))  # with these, the loss is the equations' error
    trainer, views = trained_avatar(task)
    poses, at = task.poses, int(task.trained[2])
    poses.transl[at, 0] += OFF
    with Cpu().open_equations(task, trainer.gaussians(), views) as equations:
        alone = {t: normal for t, normal in equations(trainer.gaussians()) if t == at}
        inverses = correct_each(poses.copy(), np.array([at]), trainer.gaussians, lambda gaussians: list(alone.items()))
    poses.newton = newton_steps(inverses, views)
    expected = -SHARE * inverses[at] @ alone[at].gradient
    before = poses.copy()
    grads = trainer.gradients(Step(at, views[at], 0.8, np.zeros(3), 0), Room.open())
    poses.step(at, grads.vertices, task.config.pose_rate, 0.0)
    np.testing.assert_allclose(poses.transl[at] - before.transl[at], expected[-3:], rtol=0.02, atol=1e-7)
    turns = rotation.log(np.swapaxes(rotation.exp(before.pose[at, BODY]), 1, 2) @ rotation.exp(poses.pose[at, BODY]))
    np.testing.assert_allclose(turns.ravel(), expected[:-3], rtol=0.02, atol=2e-6)
    assert abs(expected[-3]) > 0.01 * OFF


def test_a_step_is_the_same_at_any_size_of_the_images(job):
    whole = {0: person_crop(task_of(job(frames=3)).views[0])}
    half = {0: whole[0].halved()}
    of_whole, of_half = (np.diag(newton_steps({0: np.eye(UNKNOWNS)}, views)[0].inverse) for views in (whole, half))
    larger = whole[0].pixels[..., 0].size / half[0].pixels[..., 0].size
    assert of_whole / of_half == pytest.approx(larger), "the loss is a mean over the pixels, the equations are a sum"


def test_equations_that_are_not_finite_name_the_frame(job):
    task = task_of(job(frames=3))
    broken = NormalEquations(np.full(UNKNOWNS, np.nan), np.eye(UNKNOWNS), 1.0, 1000)
    with pytest.raises(StageError, match="frame 2"):
        correct_each(task.poses, task.trained, lambda: None, lambda gaussians: [(2, broken)])


@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_poses_are_corrected_together_first_and_never_where_no_round_is_asked_for(job, device):
    steps = correction_steps(job().config, 1200, device, 2)
    assert steps == sorted(set(steps)) and all(step % 2 == 0 for step in steps) and steps[0] > 0 and steps[-1] < 1200
    assert correction_steps(job(name="without", pose_rounds=0).config, 1200, device) == []
