"""The avatar as every exported format takes it: rest mesh, skeleton, skin, expressions, gaussians; its `.gsac` file.

Canonical axes: right-handed, y up, facing +z, left = +x, metres; T-pose at zero rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gsac.avatar import blend
from gsac.avatar.artifacts import AVATAR_SHAPES, LIGHT_SHAPE
from gsac.avatar.gsac_file.container import Fault, GsacError, pack, read_bytes, unpack

UNIT = 65535
SKIN_SCALE = 1 / UNIT
QUAT_SCALE = 1 / 32767
LOG_SCALE_SCALE = 1 / 2048
MAX_JOINTS = 256
MAX_LEVELS = 16
BLEND = {"low_pass_px2": blend.BLUR, "alpha_max": blend.MAX_ALPHA, "alpha_min": blend.MIN_ALPHA}
"""How a gaussian is drawn: added to the image covariance's diagonal; cap of one alpha; below this it is not drawn."""
BLEND_RANGE = {"low_pass_px2": (0, 100), "alpha_max": (0, 1), "alpha_min": (1e-6, 1)}


@dataclass
class Clip:
    """A motion: axis-angle keys of some joints at a fixed rate, linear between keys."""

    fps: float
    loop: bool
    joints: list[str]
    rotation: np.ndarray
    """(K, len(joints), 3) rad, relative to the parent joint; joints not listed do not turn."""
    transl: np.ndarray
    """(K, 3) m, added to every vertex."""


@dataclass
class RiggedAvatar:
    """V vertices, F faces, J = 55 joints, N gaussians, M moved vertices over all expressions."""

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
    gaussians: dict[str, np.ndarray]
    """The arrays of avatar.npz: face, mu, quat (wxyz), log_scale, rgb, opacity (0..1)."""
    coarser: list[dict[str, np.ndarray]] = field(default_factory=list)
    """The same arrays for levels of detail with ever fewer gaussians, to be seen from afar."""
    light: np.ndarray | None = None
    """(4, 3) of `avatar.light`, of the clip's room: what all rgb are multiplied with; None: by 1."""
    poses: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    """Still poses: name -> joint name -> axis-angle."""
    clips: dict[str, Clip] = field(default_factory=dict)
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
        """pose: (J, 3) axis-angle. Returns the mesh's vertices (V, 3)."""
        from gsac.avatar.skinning import joint_transforms, skin

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
                f"{prefix}.face": g["face"].astype(face_type),
                f"{prefix}.mu": g["mu"].astype(np.float16),
                f"{prefix}.quat": np.rint(_unit(g["quat"]) / QUAT_SCALE).astype(np.int16),
                f"{prefix}.log_scale": np.rint(np.clip(g["log_scale"], -15.9, 15.9) / LOG_SCALE_SCALE).astype(np.int16),
                f"{prefix}.rgb": g["rgb"].astype(np.float16),
                f"{prefix}.opacity": np.rint(np.clip(g["opacity"], 0, 1) * UNIT).astype(np.uint16),
            }
            scales |= {f"{prefix}.quat": QUAT_SCALE, f"{prefix}.log_scale": LOG_SCALE_SCALE, f"{prefix}.opacity": 1 / UNIT}
            levels.append({"prefix": prefix, "count": len(g["face"])})
        if self.light is not None:
            blocks["light"] = self.light.astype(np.float32)
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
        """Raises GsacError."""
        head, blocks = unpack(data, where)
        return _Reading(head, blocks, where).avatar()

    @classmethod
    def read(cls, path: Path) -> RiggedAvatar:
        """Raises GsacError."""
        return cls.from_bytes(read_bytes(path), str(path))


class _Reading:
    """Turns head and blocks into an avatar and believes nothing."""

    def __init__(self, head: dict, blocks: dict[str, np.ndarray], where: str) -> None:
        self.head, self.blocks, self.where = head, blocks, where

    def bad(self, fault: Fault, detail: str) -> GsacError:
        return GsacError(fault, self.where, detail)

    def entry(self, table: dict, key: str, kind: type | tuple[type, ...]) -> object:
        value = table.get(key) if isinstance(table, dict) else None
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.bad(Fault.HEAD, f"`{key}` is missing or of the wrong kind")
        return value

    def names(self, table: dict, key: str) -> list[str]:
        value = self.entry(table, key, list)
        if not all(isinstance(n, str) for n in value) or len(set(value)) != len(value):
            raise self.bad(Fault.HEAD, f"`{key}` is not a list of different names")
        return value

    def words(self, key: str) -> dict[str, str]:
        value = self.entry(self.head, key, dict)
        if not all(isinstance(v, str) for v in value.values()):
            raise self.bad(Fault.HEAD, f"`{key}` holds more than text")
        return value

    def block(self, name: str, shape: tuple, integer: bool = False) -> np.ndarray:
        """shape: None stands for any length. Returns int32 or float32."""
        array = self.blocks.get(name)
        if array is None:
            raise self.bad(Fault.BLOCK, f"block {name!r} is missing")
        fits = array.ndim == len(shape) and all(w in (None, n) for w, n in zip(shape, array.shape, strict=True))
        if not fits or (array.dtype.kind != "f") != integer:
            raise self.bad(Fault.BLOCK, f"block {name!r} is {array.dtype} {array.shape}, expected {shape}")
        if integer:
            if array.size and int(array.max()) > np.iinfo(np.int32).max:
                raise self.bad(Fault.VALUE, f"block {name!r} holds an index that is too large")
            return array.astype(np.int32)
        array = array.astype(np.float32)
        if not np.isfinite(array).all():
            raise self.bad(Fault.VALUE, f"block {name!r} is not finite")
        return array

    def drawing(self) -> None:
        """Checks what the head says of drawing and this reader does not keep."""
        drawn = self.entry(self.head, "blend", dict) if "blend" in self.head else {}
        found = [(self.head, "ground", (-1e6, 1e6))] + [(drawn, key, span) for key, span in BLEND_RANGE.items()]
        for table, key, (least, most) in found:
            if key in table and not least <= self.entry(table, key, (int, float)) <= most:
                raise self.bad(Fault.VALUE, f"`{key}` is out of range")

    def below(self, array: np.ndarray, limit: int, what: str) -> np.ndarray:
        if array.size and not (array.min() >= 0 and array.max() < limit):
            raise self.bad(Fault.VALUE, f"{what} points outside 0..{limit - 1}")
        return array

    def avatar(self) -> RiggedAvatar:
        if self.head.get("format") != "gsac":
            raise self.bad(Fault.HEAD, "`format` is not gsac")
        skeleton = self.entry(self.head, "joints", dict)
        joint_names = self.names(skeleton, "names")
        J = len(joint_names)
        parents = self.entry(skeleton, "parents", list)
        if len(parents) != J or not 1 <= J <= MAX_JOINTS or not all(
                type(p) is int and (-1 if j == 0 else 0) <= p < max(j, 0) for j, p in enumerate(parents)):
            raise self.bad(Fault.VALUE, "`parents` must name an earlier joint each, -1 for the first")
        vertices = self.block("rest.vertices", (None, 3))
        V = len(vertices)
        faces = self.below(self.block("rest.faces", (None, 3), True), V, "rest.faces")
        weight = self.block("skin.weight", (V, 4))
        if V == 0 or np.abs(weight.sum(1) - 1).max() > 1e-3 or weight.min() < 0:
            raise self.bad(Fault.VALUE, "skin.weight must have rows that sum to 1")
        names = self.names(self.head, "expressions")
        start = self.block("expression.start", (len(names) + 1,), True)
        moved = self.below(self.block("expression.vertex", (None,), True), V, "expression.vertex")
        if start[0] != 0 or start[-1] != len(moved) or (np.diff(start) < 0).any():
            raise self.bad(Fault.VALUE, "expression.start must rise from 0 to the number of moved vertices")
        gaussians, *coarser = self.levels(len(faces))
        self.drawing()
        return RiggedAvatar(
            vertices=vertices, faces=faces, joints=self.block("rest.joints", (J, 3)),
            parents=np.asarray(parents, np.int32), joint_names=joint_names,
            skin_index=self.below(self.block("skin.index", (V, 4), True), J, "skin.index"), skin_weight=weight,
            expression_names=names, expression_start=start, expression_vertex=moved,
            expression_delta=self.block("expression.delta", (len(moved), 3)),
            jaw_actions=self.block("expression.jaw", (len(names), 3)), gaussians=gaussians, coarser=coarser,
            light=self.block("light", LIGHT_SHAPE["light"]) if "light" in self.blocks else None,
            poses=self.poses(joint_names), clips=self.clips(joint_names),
            licence=self.words("licence"), provenance=self.words("provenance"))

    def levels(self, faces: int) -> list[dict[str, np.ndarray]]:
        """The gaussians of each level of detail, finest first."""
        levels = self.entry(self.head, "levels", list)
        if not 1 <= len(levels) <= MAX_LEVELS:
            raise self.bad(Fault.HEAD, "`levels` is empty or too long")
        prefixes = [self.entry(level, "prefix", str) for level in levels]
        if len(set(prefixes)) != len(prefixes):
            raise self.bad(Fault.HEAD, "two levels have the same gaussians")
        out = []
        for level, prefix in zip(levels, prefixes, strict=True):
            face = self.below(self.block(f"{prefix}.face", (None,), True), faces, f"{prefix}.face")
            N = len(face)
            if self.entry(level, "count", int) != N:
                raise self.bad(Fault.VALUE, f"a level says it has other than {N} gaussians")
            gaussians = {"face": face} | {name: self.block(f"{prefix}.{name}", (N, *shape[1:]))
                                          for name, shape in AVATAR_SHAPES.items() if name != "face"}
            if N and np.abs((gaussians["quat"] ** 2).sum(1) - 1).max() > 1e-2:
                raise self.bad(Fault.VALUE, f"{prefix}.quat must hold unit quaternions")
            out.append(gaussians)
        return out

    def poses(self, joint_names: list[str]) -> dict[str, dict[str, list[float]]]:
        poses = self.entry(self.head, "poses", dict)
        for name, pose in poses.items():
            rows = pose.items() if isinstance(pose, dict) else [("", None)]
            for joint, rotation in rows:
                if joint not in joint_names or not isinstance(rotation, list) or len(rotation) != 3 or not all(
                        type(x) in (int, float) and abs(x) < 100 for x in rotation):
                    raise self.bad(Fault.HEAD, f"pose {name!r} is not a table of joint -> axis-angle")
        return poses

    def clips(self, joint_names: list[str]) -> dict[str, Clip]:
        clips = {}
        for entry in self.entry(self.head, "clips", list):
            name, joints = self.entry(entry, "name", str), self.names(entry, "joints")
            fps = self.entry(entry, "fps", (int, float))
            if not set(joints) <= set(joint_names) or not 0.1 <= fps <= 1000 or name in clips:
                raise self.bad(Fault.VALUE, f"clip {name!r} names unknown joints, has an odd rate or comes twice")
            rotation = self.block(f"clip.{name}.rotation", (None, len(joints), 3))
            if not len(rotation):
                raise self.bad(Fault.VALUE, f"clip {name!r} has no keys")
            clips[name] = Clip(fps, self.entry(entry, "loop", bool), joints, rotation,
                               self.block(f"clip.{name}.transl", (len(rotation), 3)))
        return clips


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
