"""Formats that the stage does not write by itself, because fewer tools read them: each is made of an avatar's .gsac file alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.config import Pose
from gsac.stages.export.glb import splats_glb_bytes
from gsac.stages.export.sog import sog_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import Surface, paint_surface
from gsac.stages.export.usdz import usdz_bytes
from gsac.stages.export.vrm import vrm_bytes


def vrm(avatar: RiggedAvatar) -> bytes:
    """A VRM file rests in T-pose."""
    return vrm_bytes(avatar, _paint(avatar))


def usdz(avatar: RiggedAvatar) -> bytes:
    """A USDZ file moves as the first clip does."""
    return usdz_bytes(avatar, _paint(avatar))


def sog(avatar: RiggedAvatar, pose: Pose) -> bytes:
    """The gaussians in the pose."""
    return sog_bytes(*pose_gaussians(avatar, _find_pose(avatar, pose)), avatar.gaussians.rgb, avatar.gaussians.opacity)


def glb(avatar: RiggedAvatar, pose: Pose) -> bytes:
    """The gaussians in the pose."""
    return splats_glb_bytes(avatar, *pose_gaussians(avatar, _find_pose(avatar, pose)))


WRITERS: dict[str, Callable[[RiggedAvatar], bytes]] = {"vrm": vrm, "usdz": usdz}
"""Format that moves, which is the file's suffix -> its bytes."""
POSED_WRITERS: dict[str, Callable[[RiggedAvatar, Pose], bytes]] = {"sog": sog, "glb": glb}
"""Format that stands still in a pose -> its bytes."""


def _paint(avatar: RiggedAvatar) -> Surface:
    return paint_surface(avatar, *pose_gaussians(avatar, _find_pose(avatar, "t")))


def _find_pose(avatar: RiggedAvatar, pose: Pose) -> np.ndarray:
    """(J, 3) axis-angle. ArtifactError where the avatar has none of this name."""
    if pose.upper() not in avatar.poses:
        raise ArtifactError(f"the avatar has no pose {pose.upper()}; it has: {', '.join(avatar.poses) or 'none'}")
    return avatar.pose(pose.upper())
