"""The avatar that every export format is written from: rest mesh, skeleton, skin, expressions, gaussians; its `.gsac` file.

Canonical axes: right-handed, y up, facing +z, left = +x, metres; T-pose at zero rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gsac.avatar import draw_rule
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.container import pack, read_bytes, unpack
from gsac.avatar.gsac_file.read import Reader

UNIT = 65535
SKIN_SCALE = 1 / UNIT
QUAT_SCALE = 1 / 32767
LOG_SCALE_SCALE = 1 / 2048
BLEND = {"low_pass_px2": draw_rule.BLUR, "alpha_max": draw_rule.MAX_ALPHA, "alpha_min": draw_rule.MIN_ALPHA}
"""The draw rule under the file's names."""


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
        return skin(self.vertices, transforms, self.skin_index, self.skin_weight)

    def to_bytes(self) -> bytes:
        """The `.gsac` file (docs/gsac-format.md)."""
        vertex_type = np.uint16 if len(self.vertices) <= 1 << 16 else np.uint32
        face_type = np.uint16 if len(self.faces) <= 1 << 16 else np.uint32
        blocks = {
            "rest.vertices": self.vertices.astype(np.float32),
            "rest.faces": self.faces.astype(vertex_type),
            "rest.joints": self.joints.astype(np.float32),
            "skin.index": self.skin_index.astype(np.uint8),
            "skin.weight": _weights_u16(self.skin_weight),
            "expression.start": self.expression_start.astype(np.uint32),
            "expression.vertex": self.expression_vertex.astype(vertex_type),
            "expression.delta": self.expression_delta.astype(np.float16),
            "expression.jaw": self.jaw_actions.astype(np.float32),
        }
        scales, levels, clips = {"skin.weight": SKIN_SCALE}, [], []
        for n, g in enumerate([self.gaussians, *self.coarser]):
            prefix = f"gaussian{n or ''}"
            blocks |= {
                f"{prefix}.face": g.face.astype(face_type),
                f"{prefix}.mu": g.mu.astype(np.float16),
                f"{prefix}.quat": np.rint(_unit(g.quat) / QUAT_SCALE).astype(np.int16),
                f"{prefix}.log_scale": np.rint(np.clip(g.log_scale, -15.9, 15.9) / LOG_SCALE_SCALE).astype(np.int16),
                f"{prefix}.rgb": g.rgb.astype(np.float16),
                f"{prefix}.opacity": np.rint(np.clip(g.opacity, 0, 1) * UNIT).astype(np.uint16),
            }
            scales |= {f"{prefix}.quat": QUAT_SCALE, f"{prefix}.log_scale": LOG_SCALE_SCALE, f"{prefix}.opacity": 1 / UNIT}
            levels.append({"prefix": prefix, "count": len(g)})
        if self.gaussians.light is not None:
            blocks["light"] = self.gaussians.light.astype(np.float32)
        for name, clip in self.clips.items():
            blocks[f"clip.{name}.rotation"] = clip.rotation.astype(np.float32)
            blocks[f"clip.{name}.transl"] = clip.transl.astype(np.float32)
            clips.append({"name": name, "fps": clip.fps, "loop": clip.loop, "joints": clip.joints})
        head = {
            "format": "gsac", "axes": "right-handed, metres, y up, facing +z, left +x", "ground": self.ground,
            "joints": {"names": self.joint_names, "parents": self.parents.tolist()},
            "expressions": self.expression_names, "poses": self.poses, "clips": clips, "blend": BLEND,
            "levels": levels, "licence": self.licence, "provenance": self.provenance,
        }
        return pack(head, blocks, scales)

    @classmethod
    def from_bytes(cls, data: bytes, where: str = "avatar.gsac") -> RiggedAvatar:
        """From the bytes of a file; where: its name in messages. Raises `GsacError`."""
        head, blocks = unpack(data, where)
        return cls(**Reader(head, blocks, where).fields())

    @classmethod
    def read(cls, path: Path) -> RiggedAvatar:
        """From a file. Raises `GsacError`."""
        return cls.from_bytes(read_bytes(path), str(path))


def _unit(quat: np.ndarray) -> np.ndarray:
    """(N, 4) unit quaternions; those that are unit but for rounding stay as they are, zero becomes no rotation."""
    length = np.linalg.norm(quat, axis=1, keepdims=True)
    divisor = np.where(abs(length - 1) < 1e-4, 1, np.maximum(length, 1e-12))
    return np.where(length < 1e-12, (1, 0, 0, 0), quat / divisor)


def _weights_u16(weight: np.ndarray) -> np.ndarray:
    """(V, 4) weights as integers whose rows sum to exactly 65535; the largest weight takes the rounding."""
    out = np.rint(weight / weight.sum(1, keepdims=True) * UNIT).astype(np.int64)
    out[np.arange(len(out)), weight.argmax(1)] += UNIT - out.sum(1)
    return out.astype(np.uint16)
