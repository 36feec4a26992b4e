"""What is one person's own and the same in every frame: where the detector takes a point of theirs to be, where a joint lies.

A detector guesses a hip through clothes: of one person it is centimetres too high in every frame, of the next as much too low.
Believed less in each frame the hips are lost; known as one unknown of the clip their movements stay. Offsets are mirrored: x of the
right side is minus x of the left. Axes are the T-pose's, of the joint that carries the point most.
N rows are key points or joints; K unknowns in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gsac.avatar.body import Body
from gsac.avatar.wholebody import INDEX

SEEN = {"shoulder": (7, 3, 2), "elbow": (7, 2.5, 3), "wrist": (5, 2, 2), "hip": (5, 15, 4), "knee": (3, 9, 3), "ankle": (3, 6, 3),
        "big_toe": (4, 4, 7), "heel": (3, 6, 5)}
"""Spreads over people of what is left of a key point's offset, mm: of twelve truth turns, beside the offsets they all share.
Both sides go alike (hips: 15 mm together, 2 against each other), so one unknown serves both."""
JOINTS = ("hip", "spine1", "knee", "spine2", "ankle", "spine3", "neck", "collar", "head", "shoulder", "elbow", "wrist")
"""Joints that may lie off what the betas say."""


@dataclass
class Personal:
    """How key points and joints move by the unknowns: those of the joints first."""

    joints: np.ndarray  # (55, 3, Kj)
    points: np.ndarray  # (133, 3, K)
    spread: np.ndarray  # (K,) m

    @classmethod
    def of(cls, body: Body, joint_spread: float) -> Personal:
        """joint_spread: m, of each joint's offset; 0 leaves joints where the betas have them."""
        places = {name: i for i, name in enumerate(body.joint_names)}
        joints, of_joints = mirrored(dict.fromkeys(JOINTS, (1e3 * joint_spread,) * 3), places, 55)
        points, of_points = mirrored(SEEN, INDEX, 133)
        points = np.concatenate([np.zeros((133, 3, len(of_joints))), points], 2)
        return cls(joints, points, np.concatenate([of_joints, of_points]))

    def joint_offset(self, own: np.ndarray) -> np.ndarray:
        """own: (K,). Returns (55, 3) m."""
        return self.joints @ own[: self.joints.shape[2]]


def mirrored(spreads: dict[str, tuple], index: dict[str, int], rows: int) -> tuple[np.ndarray, np.ndarray]:
    """spreads: name without its side -> mm along x, y, z; 0 leaves an axis out, and so does the middle of the body for x.

    Returns (rows, 3, K) metres a unit of each unknown, and their spreads (K,) m.
    """
    columns, metres = [], []
    for name, spread in spreads.items():
        for axis in np.flatnonzero(spread):
            column = np.zeros((rows, 3))
            if name in index:
                if axis == 0:
                    continue
                column[index[name], axis] = 1
            else:
                column[index[f"left_{name}"], axis] = 1
                column[index[f"right_{name}"], axis] = -1 if axis == 0 else 1
            columns.append(column)
            metres.append(spread[axis] / 1e3)
    return np.stack(columns, 2) if columns else np.zeros((rows, 3, 0)), np.array(metres)
