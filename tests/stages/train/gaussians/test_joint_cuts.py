"""A long gaussian that a bent joint would lift off the body is cut in two, which look as it did; all others stay whole."""

import numpy as np
import pytest

from gsac.avatar.binding import Bound, bind, face_frames, unbind
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import INDEX
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians import joint_cuts
from gsac.stages.train.gaussians.joint_faces import bend_faces, face_weights
from gsac.stages.train.gaussians.joint_strays import bend_silhouettes
from gsac.stages.train.poses.turned_body import turn_before_camera
from support.hanging_arms import FRAMES, joint_at, pose_hanging_arms

LONG = 0.03


@pytest.fixture(scope="module")
def poses():
    return pose_hanging_arms()


@pytest.fixture(scope="module")
def bent(poses):
    """The body in its bends, as `cut_at_joints` takes it."""
    return bend_faces(poses, FRAMES), bend_silhouettes(poses, FRAMES)


@pytest.fixture(scope="module")
def plain(poses):
    return Gaussians.area(poses.rest(0)[0], poses.body.faces, 12000)


def along_the_arm(poses, gaussians):
    """The gaussians, those of the left forearm below the elbow LONG m along the arm; and which these are."""
    at = face_frames(poses.vertices(0), poses.body.faces)
    bound = bind(at, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    elbow, wrist = (joint_at(poses, f"left_{name}") for name in ("elbow", "wrist"))
    arm = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    which = np.flatnonzero(np.linalg.norm(bound.means - elbow - 0.03 * arm, axis=1) < 0.05)
    normal = at.R[gaussians.face[which], :, 1]
    along = arm - (normal @ arm)[:, None] * normal
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    turned = np.stack([along, normal, np.cross(along, normal)], 2)
    made = gaussians[np.arange(len(gaussians))]
    long = Bound(bound.means[which], turned, np.tile([LONG, 0.002, 0.006], (len(which), 1)))
    made.mu[which], made.quat[which], made.log_scale[which] = unbind(at, made.face[which], long)
    made.opacity[which] = 0.9
    return made, which


def excess_of(gaussians, bent):
    """(N,) by how many times what is allowed an end of each gaussian rises."""
    allowed = joint_cuts.find_allowed(bent[0].body)
    return joint_cuts.find_rise(gaussians, bent[1], allowed.min()) / allowed[gaussians.face]


def test_forearms_and_lower_legs_are_held_closer_than_the_trunk(bent):
    weights, allowed = face_weights(bent[0].body), joint_cuts.find_allowed(bent[0].body)
    for joint, there in (("right_elbow", joint_cuts.OFF_LIMB), ("left_knee", joint_cuts.OFF_LIMB), ("spine2", joint_cuts.OFF),
                         ("head", joint_cuts.OFF)):
        assert (allowed[weights[:, INDEX[joint]] > 0.9] == there).all()


def test_what_reaches_past_the_elbow_is_cut_until_it_bends_with_the_arm(poses, plain, bent):
    made, which = along_the_arm(poses, plain)
    before = excess_of(made, bent)[which]
    assert np.count_nonzero(before > 2) > 10
    cut, source = joint_cuts.cut_at_joints(made, *bent)
    after = excess_of(cut, bent)[np.isin(source, which)]
    assert np.count_nonzero(after > 2) < 0.2 * np.count_nonzero(before > 2)
    assert after.max() < 0.8 * before.max()


def test_nothing_but_what_a_bend_lifts_is_touched(poses, plain, bent):
    made, _ = along_the_arm(poses, plain)
    cut, source = joint_cuts.cut_at_joints(made, *bent)
    halves = np.bincount(source)
    whole = np.flatnonzero(halves == 1)
    assert len(plain) < len(cut) and (excess_of(made, bent)[halves > 1] > 1).all()
    np.testing.assert_array_equal(source[:len(made)], np.arange(len(made)))
    for name in ("face", "mu", "quat", "log_scale", "rgb", "opacity"):
        np.testing.assert_array_equal(getattr(cut, name)[whole], getattr(made, name)[whole])


def test_an_avatar_of_small_gaussians_stays_as_it_is(plain, bent):
    small = plain[np.arange(len(plain))]
    small.log_scale -= np.log(3).astype(np.float32)
    cut, source = joint_cuts.cut_at_joints(small, *bent)
    np.testing.assert_array_equal(source, np.arange(len(small)))
    np.testing.assert_array_equal(cut.mu, small.mu)


@pytest.mark.parametrize("opacity", [0.2, 0.6, 0.97])
def test_two_halves_look_as_the_whole_did(poses, plain, bent, opacity):
    made, which = along_the_arm(poses, plain)
    single = made[which[:1]]
    single.opacity[:] = opacity
    vertices, camera, _ = turn_before_camera(bent[1].usual.tree.data.astype(np.float32), 90.0)

    def alpha(gaussians):
        return render_bound(vertices, poses.body.faces, gaussians, camera, Workspace()).alpha.astype(float)

    whole, halves = alpha(single).copy(), alpha(joint_cuts.halve(single, bent[0])).copy()
    assert whole.max() > 0.5 * opacity
    assert ((halves - whole) ** 2).sum() < 0.03 * (whole**2).sum()
    assert halves.max() == pytest.approx(whole.max(), rel=0.12)


def test_of_many_the_worst_are_cut_and_no_more_than_there_is_room_for(plain, bent):
    long = plain[np.arange(len(plain))]
    long.log_scale[:, 0] += np.log(4).astype(np.float32)
    excess, room = excess_of(long, bent), int(joint_cuts.MOST * len(long))
    assert np.count_nonzero(excess > 1) > 1.5 * room
    cut, source = joint_cuts.cut_at_joints(long, *bent)
    assert len(cut) == len(long) + room
    taken = np.bincount(source) > 1
    assert excess[taken].min() >= np.sort(excess)[-room]


def test_what_is_left_uncut_has_room_for_its_halves():
    for most in (0, 1, 19, 600, 1300, 8000):
        whole = joint_cuts.uncut(most)
        assert whole + int(joint_cuts.MOST * whole) <= most < whole * (1 + joint_cuts.MOST) + 2
