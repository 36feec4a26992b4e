"""Offsets of one person, the same in every frame: of the detector's points, and of the joints from where the betas put them.

A detector guesses a hip through clothes: of one person centimetres too high in every frame, of the next as much too low.
Down-weighting such points per frame would lose the hips; one constant offset per clip keeps their motion. How people differ was
measured with the detector. Offsets are in the T-pose's axes, for a point in those of the joint that carries it most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.smplx.symmetry import mirror_directions

JOINTS = ("hip", "spine1", "knee", "spine2", "ankle", "spine3", "neck", "collar", "head", "shoulder", "elbow", "wrist")
"""Joints that may be offset from where the betas put them."""


@dataclass
class PersonOffsets:
    """Slopes of key points and joints by the K unknowns; those of the joints come first."""

    joints: np.ndarray  # (55, 3, Kj) m a unit
    points: np.ndarray  # (133, 3, K) m a unit
    spread: np.ndarray  # (K,) standard deviation of each unknown

    @classmethod
    def of(cls, body: Body, points: np.ndarray, joint_spread: float) -> PersonOffsets:
        """points: (133, 3, Kp) m, directions in which people differ, one standard deviation long.

        joint_spread: m, standard deviation of each joint's offset; 0 leaves joints where the betas put them.
        """
        places = {name: i for i, name in enumerate(body.joint_names)}
        joints, of_joints = mirror_directions(dict.fromkeys(JOINTS, (1e3 * joint_spread,) * 3), places, 55)
        points = np.concatenate([np.zeros((len(points), 3, len(of_joints))), points], 2)
        return cls(joints, points, np.append(of_joints, np.ones(points.shape[2] - len(of_joints))))

    def joint_offset(self, own: np.ndarray) -> np.ndarray:
        """Offsets (55, 3) m of the joints. own: (K,) unknowns."""
        return self.joints @ own[: self.joints.shape[2]]
