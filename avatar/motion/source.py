"""A motion as recorded on any skeleton, and a motion of the avatar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.joints import J
from gsac.avatar.motion import quat

LARGEST = 1e9
"""Upper limit of the numbers in a motion file: beyond it sums and products leave float32."""
MAX_BYTES = 256 << 20
"""Of a BVH, FBX or glTF file."""
RATE = 30.0
"""Frames a second at which curves are sampled, where a file holds these and no frames."""
LONGEST_S = 3600
"""Of a motion whose curves are sampled."""
MOST = 4_000_000
"""Frames times joints, the file's or ours, that are read: more would fill the memory, however small the file is."""


class MotionError(ArtifactError):
    """A motion cannot be read or does not fit a person. Names the file and the line, array or joint."""


def most_frames(joints: int) -> int:
    """Frames that are read of a motion of so many joints."""
    return MOST // max(joints, J)


def too_long(frames: int, joints: int) -> str:
    """The sentence for a motion of more than `most_frames`."""
    return f"{frames} frames of {joints} joints; at most {most_frames(joints)} are read: cut it, or save fewer frames a second"


@dataclass
class Source:
    """P joints of some skeleton over T frames, in its own world axes and units. Quaternions are xyzw."""

    fps: float
    names: list[str]
    parents: np.ndarray
    """(P,) int; parents come before children, -1 for a root."""
    rest_turns: np.ndarray
    """(P, 4) rotations in the world as the file has the skeleton at rest."""
    rest_places: np.ndarray
    """(P, 3)."""
    turns: np.ndarray
    """(T, P, 4) rotations in the world."""
    places: np.ndarray
    """(T, P, 3)."""


@dataclass
class Motion:
    """A motion of the avatar's J joints."""

    fps: float
    rotation: np.ndarray
    """(T, J, 3) float32 axis-angle relative to the parent joint, rad."""
    transl: np.ndarray
    """(T, 3) float32 m, added to every vertex."""

    @property
    def seconds(self) -> float:
        """From the first key to the last."""
        return (len(self.rotation) - 1) / self.fps

    def at(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (J, 3) and transl (3,): between keys along the shorter arc; before and after, the first and the last."""
        last = len(self.rotation) - 1
        place = min(max(seconds * self.fps, 0.0), float(last))
        k = min(int(place), max(last - 1, 0))
        share, after = place - k, min(k + 1, last)
        turned = quat.mix(quat.from_rotvec(self.rotation[k]), quat.from_rotvec(self.rotation[after]), share)
        transl = (1 - share) * self.transl[k] + share * self.transl[after]
        return quat.to_rotvec(turned).astype(np.float32), transl.astype(np.float32)
