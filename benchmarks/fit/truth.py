"""Reads truth.npz and masks of a truth clip, of the turntable or of the 104-bone rig."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import ArtifactError, frame_paths, read_arrays
from gsac.avatar.joints import BODY, NAMES, J
from gsac.avatar.wholebody import BODY_NAMES, FEET_NAMES

BONES = {"pelvis": "root", "hip": "upperleg01", "knee": "lowerleg01", "ankle": "foot", "foot": "toe3-1", "spine1": "spine04",
         "spine2": "spine02", "spine3": "spine01", "neck": "neck01", "head": "head", "collar": "clavicle",
         "shoulder": "upperarm01", "elbow": "lowerarm01", "wrist": "wrist"}
"""Joint of the body -> bone of the 104-bone rig whose head it is."""
POINTS = BODY_NAMES + FEET_NAMES
"""Names of the key points."""


@dataclass
class Truth:
    """Truth of T frames; the first joint is the pelvis."""

    joint: np.ndarray  # (n,) index of each joint in the body's first 22
    joints: np.ndarray  # (T, n, 3) m, camera frame
    vertices: np.ndarray | None  # (T, V, 3) m, bare body; None if the file has none
    keypoints: np.ndarray  # (T, 23, 2) px, COCO's body and feet
    focal: float  # px
    center: tuple[float, float]  # px
    masks: np.ndarray  # (T, H, W) bool, the person with clothes and hair

    @property
    def person_px(self) -> np.ndarray:
        """Height (T,) px of the person."""
        return np.maximum(self.masks.any(2).sum(1), 1)


def read_truth(folder: Path) -> Truth:
    """folder: truth.npz and mask/. Raises ArtifactError if arrays are missing."""
    arrays = read_arrays(folder / "truth.npz")
    masks = np.stack([cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) > 127 for p in frame_paths(folder / "mask")])
    if "focal" not in arrays or "center" not in arrays:
        raise ArtifactError(f"{folder / 'truth.npz'}: arrays focal and center are missing")
    focal, center = float(np.ravel(arrays["focal"])[0]), tuple(float(c) for c in arrays["center"])
    if "joints_cam" in arrays:
        joint, columns = _bones([str(n) for n in arrays["joint_names"]])
        names = [str(n) for n in arrays["coco_names"]]
        points = arrays["coco2d"][:, [names.index(n) for n in POINTS]]
        return Truth(joint, arrays["joints_cam"][:, columns], None, points, focal, center, masks)
    if not {"joints", "keypoints"} <= arrays.keys():
        raise ArtifactError(f"{folder / 'truth.npz'}: expected joints and keypoints (gsac.turntable) or joints_cam")
    points = arrays["keypoints"][:, :23]
    return Truth(np.arange(J)[BODY], arrays["joints"][:, BODY], arrays.get("vertices"), points, focal, center, masks)


def _bones(names: list[str]) -> tuple[np.ndarray, list[int]]:
    """Those of the body's first 22 joints (n,) that the rig has, and their columns in the rig."""
    joint, columns = [], []
    for j, name in enumerate(NAMES[BODY]):
        side, _, part = name.partition("_")
        bone = f"{BONES[part]}.{side[0].upper()}" if part else BONES[name]
        if bone in names:
            joint.append(j)
            columns.append(names.index(bone))
    return np.array(joint), columns
