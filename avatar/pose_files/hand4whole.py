"""Hand4Whole's raw outputs (Moon et al. 2022), saved by the user as one npz of all frames or one a frame.

`root_pose` 6, `body_pose` 21 x 6, `lhand_pose` and `rhand_pose` 15 x 6, `jaw_pose` 6 numbers of rotation, `shape` 10. Six numbers
are a rotation's first two columns, a 3 x 2 matrix row by row. The left hand is told as a right one in a mirror: its rotation
vectors have y and z negated. The translation is of the network's own camera and left out.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.pose_files.exavatar import PARTS
from gsac.avatar.pose_files.poses import Poses, assemble

MIRROR = np.array([1.0, -1, -1])


def is_hand4whole(arrays: dict[str, np.ndarray]) -> bool:
    """Whether the arrays (n, ...) are of this layout."""
    return {"root_pose", "body_pose"} <= arrays.keys() and arrays["root_pose"][0].size == 6


def read_hand4whole(arrays: dict[str, np.ndarray]) -> Poses:
    """The poses of arrays (n, ...)."""
    count = len(arrays["root_pose"])
    parts = {name: turn_six(arrays[theirs].reshape(count, -1, 3, 2)) for name, theirs in PARTS.items() if theirs in arrays}
    if "left_hand_pose" in parts:
        parts["left_hand_pose"] = parts["left_hand_pose"] * MIRROR
    return assemble(parts, count, None, arrays.get("shape"))


def turn_six(columns: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) rad from the two columns (..., 3, 2), not normalised (Zhou et al. 2019)."""
    first, second = columns[..., 0].astype(float), columns[..., 1].astype(float)
    x = first / np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), 1e-9)
    y = second - (x * second).sum(-1, keepdims=True) * x
    y = y / np.maximum(np.linalg.norm(y, axis=-1, keepdims=True), 1e-9)
    return rotation.log(np.stack([x, y, np.cross(x, y)], -1))
