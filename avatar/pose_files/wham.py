"""WHAM-style parameters of SMPL, saved as npz or json: `pose` (n, 72) rad and `trans` (n, 3) m in the camera's axes.

SMPL's first 22 joints are SMPL-X's. Its two hand joints and its betas mean nothing to SMPL-X and are left out.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.pose_files.poses import Poses, assemble

NUMBERS = 72
BODY_NUMBERS = 66
"""Of the 22 joints that both models share, the root's 3 first."""


def is_wham(arrays: dict[str, np.ndarray]) -> bool:
    """Whether the arrays (n, ...) are of this layout."""
    return "pose" in arrays


def read_wham(arrays: dict[str, np.ndarray]) -> Poses:
    """The poses of arrays (n, ...)."""
    pose = arrays["pose"]
    pose = pose.reshape(len(pose), -1)
    if pose.shape[1] != NUMBERS:
        raise ArtifactError(f"pose has {pose.shape[1]} numbers a frame; expected SMPL's {NUMBERS}, rotation vectors")
    parts = {"global_orient": pose[:, :3], "body_pose": pose[:, 3:BODY_NUMBERS]}
    return assemble(parts, len(pose), arrays.get("trans"), None)
