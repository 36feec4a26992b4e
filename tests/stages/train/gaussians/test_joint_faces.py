"""Joints that no frame shows bent: gaussians follow the surface that they lie on."""

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import INDEX, turn_joints
from gsac.avatar.skinning import joint_transforms, skin
from gsac.stages.train.gaussians import joint_faces
from gsac.stages.train.poses.poses import Poses

FRAMES = np.arange(2)
BESIDE = 0.05


@pytest.fixture(scope="module")
def body():
    return Body.load()


@pytest.fixture(scope="module")
def poses(body):
    """Two frames with hanging arms, turned apart."""
    pose = np.tile(turn_joints(np.zeros((55, 3)), {"shoulder": (0, 0, -60)}), (2, 1, 1))
    pose[1, 0] = [0, 1, 0]
    return Poses(body, BodyParams.from_pose(pose, np.zeros((2, 3)), np.zeros(4), np.zeros((2, body.exprdirs.shape[2])), 300.0,
                                            (64.0, 64.0)))


def place(body, poses, gaussians, turns):
    """The gaussians (a Bound) and the faces' frames in the frames' pose with some joints bent."""
    rest, joints = poses.rest(0)
    pose = turn_joints(poses.pose[0], turns)
    transforms = joint_transforms(pose[None], joints, body.parents)[0].astype(np.float32)
    frames = face_frames(skin(rest, transforms, body.skin_index, body.skin_weight), body.faces)
    return bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale), frames


def put_beside(body, poses, gaussians):
    """Binds the gaussians about the left elbow, whose indices it returns, too, to faces BESIDE them along the arm."""
    bound, at = place(body, poses, gaussians, {})
    elbow = poses.transforms(0)[INDEX["left_elbow"]] @ np.append(poses.rest(0)[1][INDEX["left_elbow"]], 1)
    which = np.flatnonzero(np.linalg.norm(bound.means - elbow, axis=1) < 0.09)
    skinned, face = joint_faces.face_weights(body), gaussians.face.copy()
    for i in which:
        alike = (np.abs(skinned - skinned[face[i]]).sum(1) < 0.9) & (at.R[:, :, 1] @ at.R[face[i], :, 1] > 0.7)
        face[i] = np.argmin(np.where(alike, np.abs(np.linalg.norm(at.T - bound.means[i], axis=1) - BESIDE), np.inf))
    return joint_faces.bind_anew(gaussians, face, bound, at), which


def test_a_gaussian_beside_its_face_follows_the_bent_elbow_and_stays_where_the_clip_has_it(body, poses):
    plain = Gaussians.area(poses.rest(0)[0], body.faces, 3000)
    plain.light = np.tile([[0.7], [0.1], [0.2], [0.2]], 3).astype(np.float32)
    beside, which = put_beside(body, poses, plain)
    held = joint_faces.hold_at_joints(beside, joint_faces.bend_faces(poses, FRAMES))
    usual, bent = {}, {"elbow": (0, -110, 0)}
    for before, after in zip(place(body, poses, beside, usual)[0], place(body, poses, held, usual)[0], strict=True):
        np.testing.assert_allclose(before, after, atol=2e-5)
    right = place(body, poses, plain, bent)[0].means[which]
    swung, kept = (np.linalg.norm(place(body, poses, each, bent)[0].means[which] - right, axis=1) for each in (beside, held))
    assert len(which) > 20 and np.quantile(swung, 0.8) > 0.02
    assert np.quantile(kept, 0.95) < 0.015 and kept.max() < swung.max() / 2
    at = place(body, poses, plain, usual)[1]
    moved = held.face != beside.face
    lit = [each.rgb[moved] * joint_faces.mean_shade(plain.light, at.R[each.face[moved], :, 1]) for each in (beside, held)]
    np.testing.assert_allclose(*lit, atol=1e-5)


def test_gaussians_that_lie_on_their_faces_stay_as_they_are(body, poses):
    plain = Gaussians.area(poses.rest(0)[0], body.faces, 3000)
    held = joint_faces.hold_at_joints(plain, joint_faces.bend_faces(poses, FRAMES))
    assert (held.face != plain.face).mean() < 0.01


def test_turned_joints_without_a_side_are_mirrored():
    pose = turn_joints(np.zeros((55, 3)), {"elbow": (0, -90, 30), "right_knee": (45, 0, 0)})
    np.testing.assert_allclose(np.degrees(pose[INDEX["left_elbow"]]), [0, -90, 30])
    np.testing.assert_allclose(np.degrees(pose[INDEX["right_elbow"]]), [0, 90, -30])
    assert np.degrees(pose[INDEX["right_knee"], 0]) == pytest.approx(45) and not pose[INDEX["left_knee"]].any()
