"""What a bent joint throws off the body is drawn in; what stands off it anyway stays."""

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians import joint_strays
from gsac.stages.train.gaussians.bends import BENDS, put_in_pose
from gsac.stages.train.gaussians.joint_faces import bind_anew
from support.hanging_arms import FRAMES, joint_at, pose_hanging_arms


@pytest.fixture(scope="module")
def poses():
    return pose_hanging_arms()


@pytest.fixture(scope="module")
def plain(poses):
    return Gaussians.area(poses.rest(0)[0], poses.body.faces, 6000)


def carried_by_the_forearm(poses, gaussians):
    """The gaussians, those of the left upper arm near the elbow bound to a face of the forearm; and which these are."""
    at = face_frames(poses.vertices(0), poses.body.faces)
    bound = bind(at, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    shoulder, elbow, wrist = (joint_at(poses, f"left_{name}") for name in ("shoulder", "elbow", "wrist"))
    which = np.flatnonzero(np.linalg.norm(bound.means - (0.6 * elbow + 0.4 * shoulder), axis=1) < 0.07)
    face = gaussians.face.copy()
    face[which] = np.argmin(np.linalg.norm(at.T - (elbow + wrist) / 2, axis=1))
    return bind_anew(gaussians, face, bound, at), which


def stray_of(gaussians, poses, pose):
    """(N,) stray alpha of gaussians in a pose."""
    seen = joint_strays.see(put_in_pose(poses, 0, pose), poses.body.faces)
    return sum(joint_strays.find_stray(gaussians, side, poses.body.faces, Workspace()) for side in seen.sides)


def stray_elbow(poses, gaussians):
    """(N,) stray alpha of gaussians where elbows bend."""
    return stray_of(gaussians, poses, turn_joints(poses.pose[0], BENDS[0]))


def test_what_lies_flat_and_is_thrown_off_by_a_bent_elbow_shrinks_and_nothing_else_changes(poses, plain):
    thrown, which = carried_by_the_forearm(poses, plain)
    seen = joint_strays.bend_silhouettes(poses, FRAMES)
    held, anyway = joint_strays.draw_in_strays(thrown, seen), joint_strays.draw_in_strays(plain, seen)
    before, after = stray_elbow(poses, thrown), stray_elbow(poses, held)
    assert before[which].sum() > 2e-3
    assert after[which].sum() < 0.5 * before[which].sum()
    shrunk = np.flatnonzero((held.log_scale < thrown.log_scale).all(1))
    assert len(shrunk) > 5
    shrinks_anyway = np.flatnonzero((anyway.log_scale < plain.log_scale).all(1))
    assert len(shrinks_anyway) < 0.005 * len(plain) and set(shrunk) <= {*which, *shrinks_anyway}
    rest = np.setdiff1d(np.arange(len(plain)), shrunk)
    np.testing.assert_array_equal(held.log_scale[rest], thrown.log_scale[rest])
    for name in ("face", "quat", "rgb", "opacity"):
        np.testing.assert_array_equal(getattr(held, name), getattr(thrown, name))
    rest = np.setdiff1d(np.arange(len(plain)), which)
    np.testing.assert_array_equal(held.mu[rest], thrown.mu[rest])


def test_hair_that_stands_off_the_head_in_the_clip_stays(poses, plain):
    at = face_frames(poses.vertices(0), poses.body.faces)
    bound = bind(at, plain.face, plain.mu, plain.quat, plain.log_scale)
    hair = np.linalg.norm(bound.means - joint_at(poses, "head") - [0, 0.1, 0], axis=1) < 0.12
    lifted = plain[np.arange(len(plain))]
    lifted.mu[hair, 1] += 0.08 / at.k[plain.face[hair]]
    usual = stray_of(lifted, poses, poses.pose[0])
    assert usual[hair].max() > 2 * joint_strays.LEAST
    held = joint_strays.draw_in_strays(lifted, joint_strays.bend_silhouettes(poses, FRAMES))
    assert (held.log_scale[hair] == lifted.log_scale[hair]).all(1).mean() > 0.95


def test_fewer_gaussians_which_are_wider_are_left_in_peace(poses):
    few = Gaussians.area(poses.rest(0)[0], poses.body.faces, 700)
    held = joint_strays.draw_in_strays(few, joint_strays.bend_silhouettes(poses, FRAMES))
    assert (held.log_scale != few.log_scale).any(1).mean() < 0.05


def test_what_a_growing_armpit_lifts_off_the_body_is_lowered_to_the_surface_around_and_hardly_shrinks(poses, plain):
    at, pose = face_frames(poses.vertices(0), poses.body.faces), turn_joints(poses.pose[0], BENDS[1])
    raised = face_frames(put_in_pose(poses, 0, pose), poses.body.faces)
    growth = (raised.k / np.maximum(at.k, 1e-9))[plain.face]
    armpit = np.flatnonzero((growth > 1.6) & (at.k[plain.face] > 0.2))[::5]
    lifted = plain[np.arange(len(plain))]
    lifted.mu[armpit, 1] += 0.012 / at.k[plain.face[armpit]]
    lifted.log_scale[armpit] = np.log(0.004 / at.k[plain.face[armpit]])[:, None]
    held = joint_strays.draw_in_strays(lifted, joint_strays.bend_silhouettes(poses, FRAMES))
    before, after = stray_of(lifted, poses, pose), stray_of(held, poses, pose)
    moved = np.flatnonzero(held.mu[:, 1] < lifted.mu[:, 1])
    assert len(moved) > 3 and np.isin(moved, armpit).mean() > 0.7
    assert after[moved].sum() < 0.3 * before[moved].sum()
    assert np.median(np.exp(held.log_scale[moved] - lifted.log_scale[moved])) > 0.75
