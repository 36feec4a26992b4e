"""Poses by Gauss-Newton: the equations of one frame against differences, the solve against the small person's truth."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.joints import BODY
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.stages.train.fast import prealign
from gsac.stages.train.fast.cpu import Cpu
from gsac.stages.train.fast.initial_gaussians import init_gaussians
from gsac.stages.train.fast.trainer import Step, Trainer
from gsac.stages.train.poses import bundle_adjust, photometric
from gsac.stages.train.poses.poses import carry_to_untrained
from gsac.stages.train.views import person_crop
from support.train_task import TRUE_SHIFT, task_of


def half_error(gaussians, poses, t, view, workspace):
    rendering = render_bound(poses.vertices(t), poses.body.faces, gaussians, view.camera, workspace)
    colour = rendering.rgb - view.pixels[..., :3] / 255
    return 0.5 * ((colour**2).sum() + photometric.MASK * ((rendering.alpha - view.pixels[..., 3] / 255) ** 2).sum())


def test_a_render_is_compared_with_its_frame_as_plain_arrays_are():
    rng = np.random.default_rng(1)
    h, w, weight = 23, 17, np.float32(0.8)
    rgb, alpha = rng.random((h, w, 3), np.float32), rng.random((h, w), np.float32)
    pixels = rng.integers(0, 256, (h, w, 4), np.uint8)
    colour, mask = np.empty((h, w, 3), np.float32), np.empty((h, w), np.float32)
    slope, squares = np.empty((h, w, 3), np.float32), np.empty((h * w, 4), np.float32)
    count = photometric.compare(rgb, alpha, pixels, weight, colour, mask, slope, squares)
    image = np.dstack([rgb, weight * alpha])
    off = image - pixels / np.float32([255, 255, 255, 255 / weight])
    person = (alpha > 0.5) | (pixels[..., 3] > 127)
    down, across = np.gradient(image, axis=(0, 1))
    expected = np.stack([across**2, across * down, down**2], 2).sum(3) / np.maximum(alpha, photometric.CLEAR)[..., None]
    assert 0 < person.sum() == count < h * w
    for got, plain in ((colour, off[..., :3]), (mask, weight * off[..., 3]), (slope, expected),
                       (squares[:count], off[person] ** 2)):
        np.testing.assert_allclose(got, plain, rtol=1e-5, atol=1e-6)


def test_the_equations_of_a_frame_are_its_slope_and_nearly_its_curvature(job):
    task, workspace = task_of(job(frames=2)), Workspace(1)
    poses, view = task.poses, person_crop(task.views[0])
    gaussians = init_gaussians(task, {0: view, 1: person_crop(task.views[1])}, 800)
    share = photometric.joint_shares(poses.body, gaussians.face)
    normal = photometric.normal_equations(gaussians, share, poses, 0, view, workspace)
    rng = np.random.default_rng(0)
    pose, transl = poses.pose[0].copy(), poses.transl[0].copy()
    for _ in range(3):
        way = rng.normal(size=photometric.UNKNOWNS) * np.append(np.full(3 * photometric.TURNING, 0.1), np.full(3, 0.03))
        errors = []
        for h in (-0.02, 0, 0.02):
            turned = rotation.exp(pose[BODY]) @ rotation.exp(h * way[:-3].reshape(-1, 3))
            poses.pose[0, BODY], poses.transl[0] = rotation.log(turned), transl + h * way[-3:]
            errors.append(half_error(gaussians, poses, 0, view, workspace))
        slope, curvature = (errors[2] - errors[0]) / 0.04, (errors[0] + errors[2] - 2 * errors[1]) / 0.02**2
        assert normal.gradient @ way == pytest.approx(slope, rel=0.05, abs=0.3)
        assert 0.7 < way @ normal.hessian @ way / curvature < 3


def test_rounds_bring_trained_and_held_out_frames_nearer_the_truth(job):
    task = task_of(job(pose_rounds=4), held=(3, 8))
    prealign.adjust(task, Cpu())
    off = np.abs(task.poses.transl[:, 0])
    assert off[task.trained].max() < 0.6 * TRUE_SHIFT and off[task.choosing].max() < 0.6 * TRUE_SHIFT
    after = carry_to_untrained(task.poses, task.trained)
    np.testing.assert_allclose(after.transl, task.poses.transl, atol=1e-6)
    np.testing.assert_array_equal(task.poses.fit_transl[:, 0], np.float32(TRUE_SHIFT))


def test_a_step_that_made_the_images_worse_is_taken_back(job):
    task = task_of(job(frames=3))
    views = {t: person_crop(task.views[t]).halved() for t in range(3)}
    trainer = Trainer(init_gaussians(task, views, 600), task)
    solving = bundle_adjust.Corrections(task.poses, trainer.gaussians,
                                        bundle_adjust.FrameEquations(task.poses, trainer.face, views))
    solving.solve()
    good = solving.kept.copy()
    solving.values = np.full_like(good, 0.5)
    solving.place()
    solving.solve()
    np.testing.assert_array_equal(solving.values, good)
    np.testing.assert_allclose(task.poses.transl, task.poses.fit_transl + good[:, -3:])


def test_rounds_in_the_midst_correct_held_out_frames_too_and_become_the_base_of_what_follows(job):
    task = task_of(job(), held=(3, 8))
    poses, views = task.poses, {int(t): person_crop(task.views[t]).halved() for t in task.trained}
    poses.transl[:, 0] -= TRUE_SHIFT
    trainer = Trainer(init_gaussians(task, views, 3000), task)
    trainer.pose_rate = 0.0
    for step, t in enumerate(np.tile(task.trained, 6)):
        trainer.learn([Step(int(t), views[int(t)], 0.3, np.ones(3), step)])
    poses.transl[:, 0] += TRUE_SHIFT / 2
    with Cpu().open_equations(task, trainer.gaussians(), views) as equations:
        bundle_adjust.correct_midway(poses, task.trained, trainer.gaussians, equations)
    off = np.abs(poses.transl[:, 0]) / (TRUE_SHIFT / 2)
    assert off.max() < 0.9 and off[task.choosing].mean() < 0.85, "they are taken to be off by little, and so move little"
    np.testing.assert_array_equal(poses.base_transl, poses.transl)
    np.testing.assert_array_equal(poses.base_pose, poses.pose)


def test_no_round_leaves_the_fit_as_it_came(job):
    task = task_of(job(frames=2, pose_rounds=0))
    prealign.adjust(task, Cpu())
    np.testing.assert_array_equal(task.poses.pose, task.poses.fit_pose)
    assert not task.poses.offset.any()


def test_photos_far_apart_keep_the_poses_of_the_fit(job):
    task = task_of(job(frames=6))
    prealign.adjust(task, Cpu())
    np.testing.assert_array_equal(task.poses.pose, task.poses.fit_pose)
    bundle_adjust.correct_midway(task.poses, task.trained, None, None)
    np.testing.assert_array_equal(task.poses.pose, task.poses.fit_pose)
    assert not bundle_adjust.are_apart(task.poses.fit_pose[:1, 0])


def test_photos_far_apart_share_only_what_is_the_same_in_all():
    few, many = bundle_adjust.covariance(7), bundle_adjust.covariance(60)
    assert few[0, 1] < bundle_adjust.SAME + 0.05 and many[0, 1] > bundle_adjust.SAME + 0.9 * bundle_adjust.NEAR


def test_a_frame_converges_to_its_own_image_and_the_others_stay(job):
    task = task_of(job(frames=3))
    views = {t: person_crop(task.views[t]) for t in range(3)}
    poses = task.poses
    poses.transl[:, 0] -= TRUE_SHIFT
    gaussians = init_gaussians(task, views, 2000)
    right = half_error(gaussians, poses, 0, views[0], Workspace(1))
    poses.transl[0, 0] += TRUE_SHIFT
    poses.pose[0, 16, 2] += 0.2
    before = poses.copy()
    assert half_error(gaussians, poses, 0, views[0], Workspace(1)) > 1.3 * right
    photometric.converge(gaussians, poses, [0], task.views, rounds=8)
    assert half_error(gaussians, poses, 0, views[0], Workspace(1)) < right
    assert abs(poses.transl[0, 0]) < 0.25 * TRUE_SHIFT and abs(poses.pose[0, 16, 2] - before.pose[0, 16, 2] + 0.2) < 0.07
    np.testing.assert_array_equal(poses.pose[1:], before.pose[1:])
    np.testing.assert_array_equal(poses.transl[1:], before.transl[1:])


def test_no_round_makes_a_frame_worse_than_it_was(job, monkeypatch):
    task = task_of(job(frames=2))
    views = {t: person_crop(task.views[t]) for t in range(2)}
    gaussians, poses = init_gaussians(task, views, 600), task.poses

    def error():
        return photometric.find_residuals(gaussians, poses, 0, views[0], Workspace(1)).mean

    before, fitted = error(), poses.pose[0].copy()
    photometric.converge(gaussians, poses, [0], task.views, rounds=0)
    np.testing.assert_array_equal(poses.pose[0], fitted)
    monkeypatch.setattr(photometric, "SPREAD_TURN", 100.0)
    monkeypatch.setattr(photometric, "CURVATURE", 0.01)
    photometric.converge(gaussians, poses, [0], task.views, rounds=1)
    np.testing.assert_array_equal(poses.pose[0], fitted)
    photometric.converge(gaussians, poses, [0], task.views, rounds=25)
    assert error() < before, "steps that are far too long become shorter until one helps"
