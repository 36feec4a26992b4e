"""Reads poses of any known layout and lays them on the clip's frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.joints import FINGERS, J
from gsac.avatar.pose_files.exavatar import is_exavatar, read_exavatar
from gsac.avatar.pose_files.files import read_frames
from gsac.avatar.pose_files.hand4whole import is_hand4whole, read_hand4whole
from gsac.avatar.pose_files.poses import Poses
from gsac.avatar.pose_files.smpler_x import is_smpler_x, read_smpler_x
from gsac.avatar.pose_files.wham import is_wham, read_wham

Arrays = dict[str, np.ndarray]
LAYOUTS: dict[str, tuple[Callable[[Arrays], bool], Callable[[Arrays], Poses]]] = {
    "ExAvatar": (is_exavatar, read_exavatar), "Hand4Whole": (is_hand4whole, read_hand4whole),
    "SMPLer-X": (is_smpler_x, read_smpler_x), "WHAM": (is_wham, read_wham)}
"""Layout -> whether arrays are of it, and its reader."""
HANDS = ("left_hand_pose", "right_hand_pose")
"""Arrays of the smplx package that may hold components in place of rotation vectors."""


@dataclass
class Start:
    """Poses of the clip's T frames, in the camera's axes (x right, y down, z away); NaN where the file says nothing."""

    rotations: np.ndarray  # (T, 55, 3, 3)
    transl: np.ndarray  # (T, 3) m
    betas: np.ndarray | None = None  # (B,) SMPL-X's

    @property
    def given(self) -> np.ndarray:
        """(T,) bool, frames that the file has."""
        return np.isfinite(self.rotations[:, 0, 0, 0])


def read_start(path: Path, frames: int, hand_means: np.ndarray | None = None, hand_components: np.ndarray | None = None) -> Start:
    """The poses on the clip's frames. Raises ArtifactError.

    frames: T; hand_means: (30, 3) rad, the body's mean fingers, to which a file's add; None: fingers are taken as they are;
    hand_components: (2, 45, 45) rad, the body's, of which a file may give the coefficients of the leading ones. A file of as many
    frames as the clip has them in order; one of fewer names them by number, from 0 as split/frames.
    """
    poses, numbers = read_poses(path, hand_components)
    count = len(poses.vectors)
    if count == frames:
        numbers = np.arange(frames)
    if numbers is None or numbers.max() >= frames or numbers.min() < 0:
        named = "" if numbers is None else f", numbered {numbers.min()} to {numbers.max()}"
        raise ArtifactError(f"{path}: it holds {count} frames{named}, but the clip has {frames}; give the poses of split/frames, "
                            "as many or numbered from 0")
    if hand_means is not None:
        poses.vectors[:, FINGERS] += hand_means
    start = Start(np.full((frames, J, 3, 3), np.nan), np.full((frames, 3), np.nan), poses.betas)
    start.rotations[numbers], start.transl[numbers] = rotation.exp(poses.vectors), poses.transl
    return start


def read_poses(path: Path, hand_components: np.ndarray | None = None) -> tuple[Poses, np.ndarray | None]:
    """The poses of n frames, and their numbers (n,) where the file has them. Raises ArtifactError.

    hand_components: (2, 45, 45) rad, the body's.
    """
    arrays, numbers = read_frames(path)
    # Text, such as a gender, and what is empty say nothing of poses.
    arrays = {name: array for name, array in arrays.items() if array.dtype.kind in "iuf" and array.ndim and array.size}
    if hand_components is not None:
        arrays |= expand_hands(arrays, hand_components)
    read = next((read for takes, read in LAYOUTS.values() if takes(arrays)), None)
    if read is None:
        raise ArtifactError(f"{path}: its arrays of numbers ({', '.join(sorted(arrays)) or 'none'}) are of none of the layouts "
                            f"{', '.join(LAYOUTS)}")
    try:
        poses = read(arrays)
    except (ArtifactError, ValueError) as e:
        raise ArtifactError(f"{path}: {e}") from e
    given = poses.vectors[:, :22]
    if not np.isfinite(given).all():
        raise ArtifactError(f"{path}: root_pose or body_pose is not finite; leave out frames without a pose")
    if numbers is not None and (len(numbers) != len(given) or len(np.unique(numbers)) != len(numbers)):
        raise ArtifactError(f"{path}: {len(numbers)} frame numbers for {len(given)} poses, or one twice; each pose needs its own")
    return poses, numbers


def expand_hands(arrays: Arrays, components: np.ndarray) -> Arrays:
    """The hands (n, 45) rad, by name, of those that arrays (n, k) hold as coefficients of the leading components (2, 45, 45)."""
    return {name: arrays[name].reshape(len(arrays[name]), -1) @ side[:arrays[name][0].size]
            for name, side in zip(HANDS, components, strict=True) if name in arrays and arrays[name][0].size < side.shape[1]}
