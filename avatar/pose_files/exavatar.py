"""ExAvatar's parameters: `smplx_params/<frame>.json` beside `shape_param.json`, or `smplx_init/<frame>.json` that its Hand4Whole
script writes (fitting/main/fit.py and run_hand4whole.py of ExAvatar_RELEASE).

`root_pose` 3, `body_pose` 21 x 3, `jaw_pose`, `leye_pose`, `reye_pose` 3, `lhand_pose` and `rhand_pose` 15 x 3 rad, `trans` 3 m,
`shape` 100 or 10.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.pose_files.poses import Poses, assemble

PARTS = {"global_orient": "root_pose", "body_pose": "body_pose", "jaw_pose": "jaw_pose", "leye_pose": "leye_pose",
         "reye_pose": "reye_pose", "left_hand_pose": "lhand_pose", "right_hand_pose": "rhand_pose"}
"""SMPL-X's name -> ExAvatar's."""


def is_exavatar(arrays: dict[str, np.ndarray]) -> bool:
    """Whether the arrays (n, ...) are of this layout."""
    return {"root_pose", "body_pose"} <= arrays.keys() and arrays["root_pose"][0].size == 3


def read_exavatar(arrays: dict[str, np.ndarray]) -> Poses:
    """The poses of arrays (n, ...)."""
    parts = {name: arrays[theirs] for name, theirs in PARTS.items() if theirs in arrays}
    return assemble(parts, len(arrays["root_pose"]), arrays.get("trans"), arrays.get("shape"))
