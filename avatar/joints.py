"""SMPL-X's 55 joints: order, names, and the groups that are treated alike."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

J = 55
NAMES = tuple((
    "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot right_foot neck "
    "left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist jaw "
    "left_eye_smplhf right_eye_smplhf"
).split() + [f"{side}_{finger}{i}" for side in ("left", "right")
             for finger in ("index", "middle", "pinky", "ring", "thumb") for i in (1, 2, 3)])
INDEX = {name: i for i, name in enumerate(NAMES)}

HEAD, JAW = INDEX["head"], INDEX["jaw"]
EYES = [INDEX["left_eye_smplhf"], INDEX["right_eye_smplhf"]]
WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]

BODY = slice(0, 22)
"""Pelvis to wrists."""
JAW_EYES = slice(22, 25)
LEFT_HAND, RIGHT_HAND = slice(25, 40), slice(40, 55)
FINGERS = slice(25, 55)
"""Of both hands."""

POSE_PARTS = {"global_orient": slice(0, 1), "body_pose": slice(1, 22), "jaw_pose": slice(22, 23), "leye_pose": slice(23, 24),
              "reye_pose": slice(24, 25), "left_hand_pose": LEFT_HAND, "right_hand_pose": RIGHT_HAND}
"""SMPL-X's names for the parts of a pose -> their joints, in joint order; together they are all 55."""


def turn_joints(pose: np.ndarray, turns: Mapping[str, tuple[float, float, float]]) -> np.ndarray:
    """(55, 3) axis-angle: pose (55, 3) with the named joints set. turns: degrees, axis-angle; a name without a side sets both,
    mirrored."""
    out = pose.copy()
    for name, degrees in turns.items():
        turn = np.radians(np.asarray(degrees, float))
        if name in INDEX:
            out[INDEX[name]] = turn
        else:
            out[INDEX[f"left_{name}"]], out[INDEX[f"right_{name}"]] = turn, turn * [1, -1, -1]
    return out
