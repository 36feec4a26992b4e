"""What is one person's own and the same in every frame: where the detector takes a point of theirs to be, where a joint lies.

A detector guesses a hip through clothes: of one person it is centimetres too high in every frame, of the next as much too low.
Believed less in each frame the hips are lost; known as one unknown of the clip their movements stay. How people differ was
measured with the detector. Axes are the T-pose's, of the joint that carries the point most. N rows are key points or joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.smplx.symmetry import mirror_directions

JOINTS = ("hip", "spine1", "knee", "spine2", "ankle", "spine3", "neck", "collar", "head", "shoulder", "elbow", "wrist")
"""Joints that may lie off what the betas say."""


@dataclass
class PersonOffsets:
    """How key points and joints move by the K unknowns: those of the joints first."""

    joints: np.ndarray  # (55, 3, Kj)
    points: np.ndarray  # (133, 3, K)
    spread: np.ndarray  # (K,) of each unknown

    @classmethod
    def of(cls, body: Body, points: np.ndarray, joint_spread: float) -> PersonOffsets:
        """points: (133, 3, Kp) m, how people differ, a standard deviation each direction; joint_spread: m, of each joint's
        offset; 0 leaves joints where the betas have them."""
        places = {name: i for i, name in enumerate(body.joint_names)}
        joints, of_joints = mirror_directions(dict.fromkeys(JOINTS, (1e3 * joint_spread,) * 3), places, 55)
        points = np.concatenate([np.zeros((len(points), 3, len(of_joints))), points], 2)
        return cls(joints, points, np.append(of_joints, np.ones(points.shape[2] - len(of_joints))))

    def joint_offset(self, own: np.ndarray) -> np.ndarray:
        """own: (K,). Returns (55, 3) m."""
        return self.joints @ own[: self.joints.shape[2]]
