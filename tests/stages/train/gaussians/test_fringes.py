"""What would hang off the person's own surface where a joint bends shrinks; clothes that stand off the body stay."""

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import HEAD, INDEX, turn_joints
from gsac.stages.train.gaussians.fringes import clothe, trim_fringes
from gsac.stages.train.gaussians.joint_faces import bind_anew, face_weights
from gsac.stages.train.poses.poses import Poses

FRAMES = np.arange(1)


@pytest.fixture(scope="module")
def poses():
    """A frame with hanging arms."""
    body = Body.load()
    pose = turn_joints(np.zeros((55, 3)), {"shoulder": (0, 0, -60)})[None]
    return Poses(body, BodyParams.from_pose(pose, np.zeros((1, 3)), np.zeros(4), np.zeros((1, body.exprdirs.shape[2])), 300.0,
                                            (64.0, 64.0)))


def wide_clothes(poses, height):
    """Gaussians that all stand so many m off the body at rest."""
    rest, faces = poses.rest(0)[0], poses.body.faces
    out = Gaussians.area(rest, faces, 6000)
    out.mu[:, 1] += height / face_frames(rest, faces).k[out.face]
    return out


def test_what_a_lifted_arm_carries_off_the_trunk_shrinks_and_nothing_else_changes(poses):
    plain = wide_clothes(poses, 0.0)
    at = face_frames(poses.vertices(0), poses.body.faces)
    bound = bind(at, plain.face, plain.mu, plain.quat, plain.log_scale)
    shoulder, elbow = (poses.transforms(0)[INDEX[name]] @ np.append(poses.rest(0)[1][INDEX[name]], 1)
                       for name in ("left_shoulder", "left_elbow"))
    side = np.flatnonzero(np.linalg.norm(bound.means - (shoulder + elbow) / 2 + [0.08, 0, 0], axis=1) < 0.05)
    face = plain.face.copy()
    face[side] = np.argmin(np.linalg.norm(at.T - (shoulder + elbow) / 2, axis=1))  # the trunk's side, carried by the arm
    hanging = bind_anew(plain, face, bound, at)
    trimmed = trim_fringes(hanging, poses, FRAMES)
    smaller = (trimmed.log_scale < hanging.log_scale).all(1)
    assert smaller[side].mean() > 10 * smaller.mean() > 0
    np.testing.assert_array_equal(trimmed.log_scale[~smaller], hanging.log_scale[~smaller])
    for name in ("face", "mu", "quat", "rgb", "opacity"):
        np.testing.assert_array_equal(getattr(trimmed, name), getattr(hanging, name))


def test_clothes_that_stand_off_the_whole_body_stay(poses):
    loose = wide_clothes(poses, 0.03)
    rest, faces = poses.rest(0)[0], poses.body.faces
    assert np.median(np.linalg.norm(clothe(loose, rest, faces) - rest, axis=1)) == pytest.approx(0.03, abs=0.005)
    smaller = (trim_fringes(loose, poses, FRAMES).log_scale < loose.log_scale).any(1)
    assert smaller.mean() < 0.06  # at joints that bend
    assert not smaller[face_weights(poses.body)[loose.face].argmax(1) == HEAD].any()
