"""Rotations from anny's rest pose (arms hanging, away from the body) to the T-pose."""

from __future__ import annotations

import sys

import numpy as np
from skeleton import FINGERS, JOINTS, head_bone


def rotate_onto(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Smallest rotation (3, 3) from direction a (3,) to direction b (3,)."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    v, c = np.cross(a, b), a @ b
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + k + k @ k / (1 + c)


def twist_x(angle: float) -> np.ndarray:
    """Rotation (3, 3) about x; angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def t_pose_rotations(heads: dict[str, np.ndarray], tails: dict[str, np.ndarray]) -> np.ndarray:
    """World rotation (55, 3, 3) of every joint from anny's rest pose to the T-pose.

    heads, tails: bone -> (3,) m. Arms and straight fingers lie along +-x, palms down; trunk, legs, head and thumbs keep their
    orientation.
    """
    rot = {j: np.eye(3) for j in JOINTS}
    for side, s in (("left", 1.0), ("right", -1.0)):
        x = np.array([s, 0, 0])
        at = {j: heads[head_bone(f"{side}_{j}")] for j in ("shoulder", "elbow", "wrist", "middle1", "index1", "pinky1")}
        upper = rotate_onto(at["elbow"] - at["shoulder"], x)
        fore = rotate_onto(upper @ (at["wrist"] - at["elbow"]), x) @ upper
        hand = rotate_onto(fore @ (at["middle1"] - at["wrist"]), x) @ fore
        across = hand @ (at["index1"] - at["pinky1"])
        turn = np.arctan2(across[1], across[2])  # index in front of pinky: palm down
        hand = twist_x(turn) @ hand
        fore = twist_x(turn / 2) @ fore  # half of the turn in the forearm, as an arm does it
        print(f"{side}: palm turn {np.degrees(turn):.1f} degrees", file=sys.stderr)
        rot[f"{side}_shoulder"], rot[f"{side}_elbow"], rot[f"{side}_wrist"] = upper, fore, hand
        for finger in FINGERS:
            names = [f"{side}_{finger}{i}" for i in (1, 2, 3)]
            bones = [head_bone(n) for n in names]
            parent = hand
            for n, b in zip(names, bones, strict=True):
                along = parent @ (tails[b] - heads[b])
                if finger == "thumb":
                    rot[n] = parent
                    continue
                if n.endswith("1"):
                    flat = along * np.array([1, 0, 1])
                rot[n] = rotate_onto(along, flat) @ parent
                parent = rot[n]
    return np.stack([rot[j] for j in JOINTS])
