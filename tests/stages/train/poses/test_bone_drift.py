"""Bones turned back to where the fit has them: the clip stays, a drift of all frames goes, a real correction does not."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.poses import bone_drift
from gsac.stages.train.poses.poses import Poses

FRAMES = np.arange(12)
DRIFTED = [1, 4, 6, 16, 18]
"""Left hip and knee, spine, left shoulder and elbow."""


@pytest.fixture
def clip(job):
    """Poses of a turn, as fitted, and gaussians all over the body."""
    poses = Poses(Body.load(), BodyParams.read(job().inputs["smplx/body.npz"]))
    return poses, Gaussians.area(poses.rest(0)[0], poses.body.faces, 2000, 0)


def turn(poses, joints, angle):
    """All frames, each of the joints by so many rad about an axis of its own."""
    axes = np.random.default_rng(3).normal(size=(len(joints), 3))
    axes *= angle / np.linalg.norm(axes, axis=1, keepdims=True)
    poses.pose[:, joints] = rotation.log(rotation.exp(poses.pose[:, joints]) @ rotation.exp(axes))
    poses.settle()


def places(gaussians, poses, t):
    frames = face_frames(poses.vertices(t), poses.body.faces)
    return bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale).means


def off(poses):
    """(55,) rad between the pose as it stands and the fit's, mean over the frames."""
    between = np.swapaxes(rotation.exp(poses.fit_pose), -1, -2) @ rotation.exp(poses.pose)
    return np.linalg.norm(rotation.log(between), axis=-1).mean(0)


def miss(gaussians, poses):
    """m / m in the image, between the gaussians in the fit's angles and in the refined ones; what shifts them all aside."""
    fitted = poses.copy()
    fitted.pose = poses.fit_pose
    apart = []
    for t in FRAMES:
        one, other = (places(gaussians, which, t) for which in (fitted, poses))
        apart.append(one[:, :2] / one[:, 2:] - other[:, :2] / other[:, 2:])
    return np.std(np.concatenate(apart), axis=0).max()


def test_the_fits_angles_draw_what_the_refined_ones_do_and_the_clip_looks_as_before(clip):
    poses, gaussians = clip
    turn(poses, DRIFTED, 0.03)
    before, missed = [places(gaussians, poses, t) for t in FRAMES], miss(gaussians, poses)
    moved = bone_drift.remove_drift(poses, FRAMES).undo(gaussians)
    assert miss(moved, poses) < 0.7 * missed
    for t in FRAMES:
        apart = np.linalg.norm(places(moved, poses, t) - before[t], axis=1)
        assert np.median(apart) < 1e-4 and np.quantile(apart, 0.99) < 4e-3


def test_a_drift_is_found_exactly_where_nothing_holds_it(clip, monkeypatch):
    poses, gaussians = clip
    turn(poses, DRIFTED, 0.03)
    for name, value in (("TURN", 50.0), ("ROUNDS", 8), ("MOST", 3.0)):
        monkeypatch.setattr(bone_drift, name, value)
    bone_drift.remove_drift(poses, FRAMES)
    assert off(poses)[:22].max() < 0.005


def test_frames_not_trained_on_are_turned_back_too(clip):
    poses, gaussians = clip
    turn(poses, DRIFTED, 0.03)
    before = places(gaussians, poses, 5)
    moved = bone_drift.remove_drift(poses, np.delete(FRAMES, 5)).undo(gaussians)
    assert np.median(np.linalg.norm(places(moved, poses, 5) - before, axis=1)) < 2e-4
    np.testing.assert_array_equal(poses.pose, poses.base_pose)


def test_poses_as_fitted_and_what_differs_from_frame_to_frame_stay(clip):
    poses, gaussians = clip
    same = bone_drift.remove_drift(poses, FRAMES).undo(gaussians)
    np.testing.assert_allclose(same.mu, gaussians.mu, atol=1e-4)
    assert off(poses).max() < 1e-6
    poses.pose[::2, 18, 1] += 0.1
    poses.pose[1::2, 18, 1] -= 0.1
    bone_drift.remove_drift(poses, FRAMES)
    assert off(poses)[18] > 0.08


def test_a_joint_that_the_fit_had_far_off_keeps_most_of_its_correction(clip):
    poses, gaussians = clip
    turn(poses, [18], 0.5)
    bone_drift.remove_drift(poses, FRAMES)
    assert off(poses)[18] > 0.4


def test_a_copy_of_the_poses_keeps_the_drift(clip):
    poses, _ = clip
    turn(poses, DRIFTED, 0.03)
    kept = poses.copy()
    before = kept.pose.copy(), kept.base_pose.copy(), kept.joint_offset.copy()
    bone_drift.remove_drift(poses, FRAMES)
    for now, then in zip((kept.pose, kept.base_pose, kept.joint_offset), before, strict=True):
        np.testing.assert_array_equal(now, then)
