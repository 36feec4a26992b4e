"""SMPLer-X's and SMPLest-X's parameters: an npz a frame, or one of all frames, under the names of the smplx package.

`global_orient` 3, `body_pose` 21 x 3, `left_hand_pose` and `right_hand_pose` 15 x 3, `jaw_pose`, `leye_pose`, `reye_pose` 3 rad,
`transl` 3 m, `betas` 10.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import POSE_PARTS
from gsac.avatar.pose_files.poses import Poses, assemble


def is_smpler_x(arrays: dict[str, np.ndarray]) -> bool:
    """Whether the arrays (n, ...) are of this layout."""
    return {"global_orient", "body_pose"} <= arrays.keys()


def read_smpler_x(arrays: dict[str, np.ndarray]) -> Poses:
    """The poses of arrays (n, ...)."""
    parts = {name: arrays[name] for name in POSE_PARTS if name in arrays}
    return assemble(parts, len(arrays["global_orient"]), arrays.get("transl"), arrays.get("betas"))
