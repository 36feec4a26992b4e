"""From the head and the blocks of a `.gsac` file to an avatar's fields; nothing is believed before it is checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from gsac.avatar.artifacts import AVATAR_SHAPES, LIGHT_SHAPE
from gsac.avatar.draw_rule import ADDED, LowPass
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.container import Fault, GsacError
from gsac.avatar.sparse_correctives import SparseCorrectives

MAX_JOINTS = 256
MAX_LEVELS = 16
BLEND_RANGE = {"low_pass_px2": (0, 100), "alpha_max": (0, 1), "alpha_min": (1e-6, 1)}
HEIGHT_RANGE = (1, 1e6)


class Reader:
    """Checks head and blocks and turns them into the fields of a `RiggedAvatar`; whatever is wrong raises `GsacError`."""

    def __init__(self, head: dict, blocks: dict[str, np.ndarray], where: str) -> None:
        """head, blocks: name -> array (...), of `unpack`; where: the file's name in messages."""
        self.head, self.blocks, self.where = head, blocks, where

    def bad(self, fault: Fault, detail: str) -> GsacError:
        """The error to raise."""
        return GsacError(fault, self.where, detail)

    def entry(self, table: dict, key: str, kind: type | tuple[type, ...]) -> Any:
        """The value at a key of the head or of an object in it, of that kind."""
        value = table.get(key) if isinstance(table, dict) else None
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.bad(Fault.HEAD, f"`{key}` is missing or of the wrong kind")
        return value

    def names(self, table: dict, key: str) -> list[str]:
        """A list of different names at a key."""
        value = self.entry(table, key, list)
        if not all(isinstance(n, str) for n in value) or len(set(value)) != len(value):
            raise self.bad(Fault.HEAD, f"`{key}` is not a list of different names")
        return value

    def texts(self, key: str) -> dict[str, str]:
        """An object that holds only texts, at a key of the head."""
        value = self.entry(self.head, key, dict)
        if not all(isinstance(v, str) for v in value.values()):
            raise self.bad(Fault.HEAD, f"`{key}` holds more than text")
        return value

    def block(self, name: str, shape: tuple, integer: bool = False) -> np.ndarray:
        """The array of a block, int32 or float32, of that shape (None, 3, ...); None stands for any length."""
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

    def number(self, table: dict, key: str, span: tuple[float, float]) -> float:
        """The number at a key, within `span`."""
        value = self.entry(table, key, (int, float))
        if not span[0] <= value <= span[1]:
            raise self.bad(Fault.VALUE, f"`{key}` is out of range")
        return value

    def low_pass(self) -> LowPass:
        """The filter of the draw rule, 3DGS's where the head names none; the rest of the rule and the ground are only checked."""
        drawn = self.entry(self.head, "blend", dict) if "blend" in self.head else {}
        found = [(self.head, "ground", (-1e6, 1e6))] + [(drawn, key, span) for key, span in BLEND_RANGE.items()]
        for table, key, span in found:
            if key in table:
                self.number(table, key, span)
        keeps_energy = self.entry(drawn, "low_pass_energy", bool) if "low_pass_energy" in drawn else ADDED.keeps_energy
        return LowPass(float(drawn.get("low_pass_px2", ADDED.px2)), keeps_energy)

    def check_indices(self, array: np.ndarray, limit: int, what: str) -> np.ndarray:
        """The array (...) itself, if it holds indices in 0..limit - 1 only."""
        if array.size and not (array.min() >= 0 and array.max() < limit):
            raise self.bad(Fault.VALUE, f"{what} points outside 0..{limit - 1}")
        return array

    def fields(self) -> dict[str, Any]:
        """Name -> value of every field of `RiggedAvatar`."""
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
        faces = self.check_indices(self.block("rest.faces", (None, 3), True), V, "rest.faces")
        weight = self.block("skin.weight", (V, 4))
        if V == 0 or np.abs(weight.sum(1) - 1).max() > 1e-3 or weight.min() < 0:
            raise self.bad(Fault.VALUE, "skin.weight must have rows that sum to 1")
        names = self.names(self.head, "expressions")
        start = self.block("expression.start", (len(names) + 1,), True)
        moved = self.check_indices(self.block("expression.vertex", (None,), True), V, "expression.vertex")
        self.check_rise(start, len(moved), "expression.start")
        gaussians, *coarser = self.levels(len(faces))
        return dict(
            vertices=vertices, faces=faces, joints=self.block("rest.joints", (J, 3)),
            parents=np.asarray(parents, np.int32), joint_names=joint_names,
            skin_index=self.check_indices(self.block("skin.index", (V, 4), True), J, "skin.index"), skin_weight=weight,
            expression_names=names, expression_start=start, expression_vertex=moved,
            expression_delta=self.block("expression.delta", (len(moved), 3)),
            jaw_actions=self.block("expression.jaw", (len(names), 3)), gaussians=gaussians, coarser=coarser,
            correctives=self.correctives(V, J), poses=self.poses(joint_names), clips=self.clips(joint_names),
            licence=self.texts("licence"), provenance=self.texts("provenance"))

    def check_rise(self, start: np.ndarray, end: int, what: str) -> None:
        """Raises unless start (n,) rises from 0 to end."""
        if start[0] != 0 or start[-1] != end or (np.diff(start) < 0).any():
            raise self.bad(Fault.VALUE, f"{what} must rise from 0 to {end}, the number of its rows")

    def correctives(self, vertices: int, joints: int) -> SparseCorrectives | None:
        """The pose correctives; None where the file has none."""
        if "corrective.start" not in self.blocks:
            return None
        joint = self.check_indices(self.block("corrective.joint", (None,), True), joints, "corrective.joint")
        start = self.block("corrective.start", (vertices + 1,), True)
        self.check_rise(start, len(joint), "corrective.start")
        return SparseCorrectives(start, joint, self.block("corrective.delta", (len(joint), 3, 9)))

    def levels(self, faces: int) -> list[Gaussians]:
        """The gaussians of each level of detail, finest first."""
        levels = self.entry(self.head, "levels", list)
        if not 1 <= len(levels) <= MAX_LEVELS:
            raise self.bad(Fault.HEAD, "`levels` is empty or too long")
        prefixes = [self.entry(level, "prefix", str) for level in levels]
        if len(set(prefixes)) != len(prefixes):
            raise self.bad(Fault.HEAD, "two levels have the same gaussians")
        light = self.block("light", LIGHT_SHAPE["light"]) if "light" in self.blocks else None
        low_pass = self.low_pass()
        out = []
        for level, prefix in zip(levels, prefixes, strict=True):
            face = self.check_indices(self.block(f"{prefix}.face", (None,), True), faces, f"{prefix}.face")
            N = len(face)
            if self.entry(level, "count", int) != N:
                raise self.bad(Fault.VALUE, f"a level says it has other than {N} gaussians")
            height = None if level.get("max_height_px") is None else float(self.number(level, "max_height_px", HEIGHT_RANGE))
            gaussians = Gaussians(face, light=light, low_pass=low_pass, max_height_px=height, **{
                name: self.block(f"{prefix}.{name}", (N, *shape[1:])) for name, shape in AVATAR_SHAPES.items() if name != "face"})
            if N and np.abs((gaussians.quat ** 2).sum(1) - 1).max() > 1e-2:
                raise self.bad(Fault.VALUE, f"{prefix}.quat must hold unit quaternions")
            out.append(gaussians)
        return out

    def poses(self, joint_names: list[str]) -> dict[str, dict[str, list[float]]]:
        """Still poses: name -> joint name -> axis-angle."""
        poses = self.entry(self.head, "poses", dict)
        for name, pose in poses.items():
            rows = pose.items() if isinstance(pose, dict) else [("", None)]
            for joint, rotation in rows:
                if joint not in joint_names or not isinstance(rotation, list) or len(rotation) != 3 or not all(
                        type(x) in (int, float) and abs(x) < 100 for x in rotation):
                    raise self.bad(Fault.HEAD, f"pose {name!r} is not a table of joint -> axis-angle")
        return poses

    def clips(self, joint_names: list[str]) -> dict[str, Animation]:
        """Animations by name."""
        clips = {}
        for entry in self.entry(self.head, "clips", list):
            name, joints = self.entry(entry, "name", str), self.names(entry, "joints")
            fps = self.entry(entry, "fps", (int, float))
            if not set(joints) <= set(joint_names) or not 0.1 <= fps <= 1000 or name in clips:
                raise self.bad(Fault.VALUE, f"clip {name!r} names unknown joints, has an odd rate or comes twice")
            rotation = self.block(f"clip.{name}.rotation", (None, len(joints), 3))
            if not len(rotation):
                raise self.bad(Fault.VALUE, f"clip {name!r} has no keys")
            clips[name] = Animation(fps, self.entry(entry, "loop", bool), joints, rotation,
                               self.block(f"clip.{name}.transl", (len(rotation), 3)))
        return clips
