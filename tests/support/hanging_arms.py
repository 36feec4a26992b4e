"""A body of one frame with hanging arms, and where its joints are."""

import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.joints import INDEX, turn_joints
from gsac.stages.train.poses.poses import Poses

FRAMES = np.arange(1)


def pose_hanging_arms():
    """The poses of that frame."""
    body = Body.load()
    pose = turn_joints(np.zeros((55, 3)), {"shoulder": (0, 0, -60)})[None]
    return Poses(body, BodyParams.from_pose(pose, np.zeros((1, 3)), np.zeros(4), np.zeros((1, body.exprdirs.shape[2])), 300.0,
                                            (64.0, 64.0)))


def joint_at(poses, name):
    """(3,) m in the frame."""
    return poses.transforms(0)[INDEX[name]] @ np.append(poses.rest(0)[1][INDEX[name]], 1)
