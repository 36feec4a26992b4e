"""The clip's usual pose, and the bends that are sampled on top of it: a clip of a turning person bends no joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.binding import FaceFrames, face_frames
from gsac.avatar.mesh import vertex_normals
from gsac.stages.train.poses.poses import Poses

BENDS = (
    {"elbow": (0, -115, 0)},
    {"shoulder": (0, 0, 60), "collar": (0, 0, 15)},
    {"shoulder": (0, -80, 0)},
    {"shoulder": (0, 0, 0)},
    {"shoulder": (-60, 0, 0), "elbow": (0, -100, 0)},
    {"shoulder": (45, 0, -50), "elbow": (0, -100, 0)},
    {"hip": (-100, 15, 12), "knee": (120, 0, 0), "spine1": (15, 0, 0)},
    {"hip": (20, 0, 0), "knee": (115, 0, 0)},
    {"hip": (0, 0, 30), "wrist": (0, 0, 50), "neck": (0, 40, 0), "ankle": (-30, 0, 0)},
    {"wrist": (0, 0, -50), "neck": (25, 0, 0), "spine2": (20, 0, 0), "ankle": (30, 0, 0)},
)
"""What is bent in each sampled pose; the other joints stay as the clip has them."""


def usual_pose(pose: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """(55, 3) axis-angle, the median of frames (n,), upright before the camera. pose: (T, 55, 3) axis-angle."""
    out = np.median(pose[frames], 0)
    out[0] = 0
    return out


class Placed(NamedTuple):
    """A posed body's surface in space."""

    frames: FaceFrames
    tree: KDTree
    """Of its vertices."""
    normals: np.ndarray
    """(V, 3) of the vertices."""


def place(posed: np.ndarray, faces: np.ndarray) -> Placed:
    """The surface of the body posed (V, 3) m. faces: (F, 3)."""
    return Placed(face_frames(posed, faces), KDTree(posed), vertex_normals(posed, faces))


def put_in_pose(poses: Poses, t: int, pose: np.ndarray) -> np.ndarray:
    """(V, 3) m, the body of frame t in another pose, (55, 3) axis-angle."""
    return poses.body.bend(*poses.rest(t), pose)
