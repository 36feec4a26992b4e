"""The avatar that every export format is written from: rest mesh, skeleton, skin, expressions, gaussians.

Canonical axes: right-handed, y up, facing +z, left = +x, metres; T-pose at zero rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.container import read_bytes, unpack
from gsac.avatar.gsac_file.read import Reader
from gsac.avatar.sparse_correctives import SparseCorrectives


@dataclass
class RiggedAvatar:
    """V vertices, F faces, J = 55 joints, E expressions, N gaussians, M moved vertices over all expressions."""

    vertices: np.ndarray
    """(V, 3) float32, m: the person's rest shape."""
    faces: np.ndarray
    """(F, 3) int32."""
    joints: np.ndarray
    """(J, 3) float32, m: rest places."""
    parents: np.ndarray
    """(J,) int32, -1 at the root."""
    joint_names: list[str]
    skin_index: np.ndarray
    """(V, 4) int32."""
    skin_weight: np.ndarray
    """(V, 4) float32, rows sum to 1."""
    expression_names: list[str]
    expression_start: np.ndarray
    """(E + 1,) int32: expression e moves the vertices `expression_vertex[start[e]:start[e + 1]]`."""
    expression_vertex: np.ndarray
    """(M,) int32."""
    expression_delta: np.ndarray
    """(M, 3) float32, m at weight 1."""
    jaw_actions: np.ndarray
    """(E, 3) float32: expression weights that a rotation of the jaw joint, axis-angle, stands for."""
    gaussians: Gaussians
    """The finest level of detail; its light is that of all levels."""
    coarser: list[Gaussians] = field(default_factory=list)
    """Levels of detail with ever fewer gaussians, to be seen from afar."""
    poses: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    """Still poses: name -> joint name -> axis-angle."""
    clips: dict[str, Animation] = field(default_factory=dict)
    correctives: SparseCorrectives | None = None
    """What turned joints add to the vertices at rest beside skinning; None where the body has no such thing."""
    licence: dict[str, str] = field(default_factory=dict)
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def ground(self) -> float:
        """y of the floor under the rest shape, m."""
        return float(self.vertices[:, 1].min())

    def pose(self, name: str) -> np.ndarray:
        """(J, 3) axis-angle of a still pose."""
        out = np.zeros((len(self.joints), 3), np.float32)
        for joint, rotation in self.poses[name].items():
            out[self.joint_names.index(joint)] = rotation
        return out

    def posed(self, pose: np.ndarray) -> np.ndarray:
        """Vertices (V, 3), m, of the mesh in a pose (J, 3), axis-angle."""
        from gsac.avatar.skinning import joint_transforms, skin  # numba, which a reader of files can do without

        transforms = joint_transforms(pose[None].astype(np.float32), self.joints, self.parents)[0]
        rest = self.vertices if self.correctives is None else self.vertices + self.correctives.move_rest(pose)
        return skin(rest, transforms, self.skin_index, self.skin_weight)

    @classmethod
    def from_bytes(cls, data: bytes, where: str = "avatar.gsac") -> RiggedAvatar:
        """From the bytes of a file; where: its name in messages. Raises `GsacError`."""
        head, blocks = unpack(data, where)
        return cls(**Reader(head, blocks, where).fields())

    @classmethod
    def read(cls, path: Path) -> RiggedAvatar:
        """From a file. Raises `GsacError`."""
        return cls.from_bytes(read_bytes(path), str(path))
