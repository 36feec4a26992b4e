"""Reads a motion file of another tool as a motion of the avatar."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.motion.amass import read_amass
from gsac.avatar.motion.bvh import read_bvh
from gsac.avatar.motion.fbx import read_fbx
from gsac.avatar.motion.gltf import read_gltf
from gsac.avatar.motion.retarget import retarget
from gsac.avatar.motion.source import Motion, MotionError

GLTF = (".glb", ".gltf", ".vrma")
SUFFIXES = (".bvh", ".fbx", *GLTF, ".npz")


def read_motion(path: Path, joint_names: list[str], parents: np.ndarray, joints: np.ndarray) -> Motion:
    """A BVH, FBX, glTF or AMASS-style npz file as a motion of the skeleton joint_names (J), parents (J,), joints (J, 3) at rest, m.

    Raises `MotionError`, naming the file and the line or array.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise MotionError(f"{path}: motion is read from {', '.join(SUFFIXES)}, not from {suffix or 'a file without suffix'}")
    if suffix == ".npz":
        source = read_amass(path, joint_names, parents, joints)
    else:
        source = (read_gltf if suffix in GLTF else read_bvh if suffix == ".bvh" else read_fbx)(path)
    return retarget(source, joint_names, parents, joints, str(path))
