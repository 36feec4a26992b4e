"""`avatar.glb`: a skinned, vertex-coloured, animated mesh for any glTF tool, and the gaussians.

Mesh: 55 joints with identity rest rotations, at most 4 weights a vertex, y up, facing +z, feet at y = 0; expressions are
morph targets by their ARKit names.
Gaussians: in a scene of their own, so that what shows the file shows one person: a POINTS primitive in T-pose with
KHR_gaussian_splatting (its release candidate: linear scales, opacities after the sigmoid). They have no skin, which readers of
splats ignore; `_GSAC_FACE` holds the mesh face that each is bound to.
"""

from __future__ import annotations

import json
import struct

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.rotation import to_xyzw
from gsac.stages.export.ply import SH0

FLOAT, U16, U32, U8 = 5126, 5123, 5125, 5121
CODES = {np.dtype("<f4"): FLOAT, np.dtype("<u2"): U16, np.dtype("<u4"): U32, np.dtype("u1"): U8}
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
POINTS, TRIANGLES = 0, 4
SPLATS = "KHR_gaussian_splatting"
NEAREST = 8
"""Number of gaussians that a vertex takes its colour from."""
BLUR_M = 0.004
"""Distance, m, below which gaussians count alike."""


def glb_bytes(avatar: RiggedAvatar, means: np.ndarray, quats: np.ndarray, scales: np.ndarray) -> bytes:
    """The file's bytes. means: (N, 3) m, quats: (N, 4) wxyz, scales: (N, 3) m, of the gaussians in T-pose, feet at y = 0."""
    file = _Buffer()
    J, g = len(avatar.joints), avatar.gaussians
    ground = np.array([0, avatar.ground, 0], np.float32)
    vertices, joints = avatar.vertices - ground, avatar.joints - ground
    inverse = np.tile(np.eye(4, dtype=np.float32), (J, 1, 1))
    inverse[:, 3, :3] = -joints
    nodes = []
    for j, (name, parent) in enumerate(zip(avatar.joint_names, avatar.parents, strict=True)):
        node = {"name": name, "translation": (joints[j] - (joints[parent] if parent >= 0 else 0)).tolist()}
        children = np.flatnonzero(avatar.parents == j).tolist()
        nodes.append(node | ({"children": children} if children else {}))
    colours = vertex_colours(vertices, means, g.rgb, g.opacity)
    root = int(np.flatnonzero(avatar.parents < 0)[0])
    skin = {"joints": list(range(J)), "skeleton": root, "inverseBindMatrices": file.add(inverse.reshape(J, 16))}
    mesh = {"primitives": [{
        "mode": TRIANGLES, "material": 0, "indices": file.add(avatar.faces.reshape(-1).astype("<u4"), ELEMENT_BUFFER),
        "attributes": {
            "POSITION": file.add(vertices, ARRAY_BUFFER, bounds=True),
            "NORMAL": file.add(vertex_normals(vertices, avatar.faces).astype(np.float32), ARRAY_BUFFER),
            "COLOR_0": file.add(_linear(colours), ARRAY_BUFFER),
            **_skin_attributes(file, avatar.skin_index, avatar.skin_weight),
        }}], "name": "body"}
    if avatar.expression_names:
        mesh["primitives"][0]["targets"] = _targets(file, avatar)
        mesh |= {"weights": [0.0] * len(avatar.expression_names), "extras": {"targetNames": avatar.expression_names}}
    rgb = np.clip(g.rgb, 0, 1)
    points = {"primitives": [{
        "mode": POINTS, "attributes": {
            "POSITION": file.add(means.astype("<f4"), ARRAY_BUFFER, bounds=True),
            "COLOR_0": file.add(np.column_stack([_linear(rgb), g.opacity]).astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:ROTATION": file.add(to_xyzw(quats).astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:SCALE": file.add(scales.astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:OPACITY": file.add(g.opacity.astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:SH_DEGREE_0_COEF_0": file.add(((g.rgb - 0.5) / SH0).astype("<f4"), ARRAY_BUFFER),
            "_GSAC_FACE": file.add(g.face.astype("<f4"), ARRAY_BUFFER),
        }, "extensions": {SPLATS: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display",
                                   "projection": "perspective", "sortingMethod": "cameraDistance"}}}],
        "name": "gaussians"}
    nodes += [{"name": "body", "mesh": 0, "skin": 0}, {"name": "gaussians", "mesh": 1}]
    document = {
        "asset": {"version": "2.0", "generator": "gsac", "copyright": "; ".join(avatar.licence.values())},
        "extensionsUsed": [SPLATS], "scene": 0,
        "scenes": [{"name": "avatar", "nodes": [root, J]}, {"name": "gaussians", "nodes": [J + 1]}], "nodes": nodes, "meshes": [mesh, points],
        "skins": [skin],
        "materials": [{"name": "vertex colours",
                       "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.9}}],
    }
    if avatar.clips:
        document["animations"] = [
            _animation(file, name, clip, avatar, document["nodes"][root]["translation"], root)
            for name, clip in avatar.clips.items()]
    return file.glb(document)


def vertex_colours(vertices: np.ndarray, means: np.ndarray, rgb: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """vertices: (V, 3) m; means: (N, 3) m in the same pose; rgb: (N, 3) sRGB; opacity: (N,).

    Returns (V, 3) float32 sRGB: the mean over the nearest gaussians, weighted by opacity and nearness. The binding does not serve:
    training moves gaussians away from the face that carries them.
    """
    distance, near = cKDTree(means).query(vertices, k=min(NEAREST, len(means)))
    distance, near = distance.reshape(len(vertices), -1), near.reshape(len(vertices), -1)
    weight = (opacity[near] + 1e-6) / (distance ** 2 + BLUR_M ** 2)
    return np.einsum("vk,vkc->vc", weight / weight.sum(1, keepdims=True), np.clip(rgb, 0, 1)[near]).astype(np.float32)


def _linear(srgb: np.ndarray) -> np.ndarray:
    """sRGB to linear light, which glTF's COLOR_0 holds."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _skin_attributes(file: _Buffer, index: np.ndarray, weight: np.ndarray) -> dict[str, int]:
    """index, weight: (n, 4). Joints without weight become 0, as the glTF validator demands."""
    weight = (weight / weight.sum(1, keepdims=True)).astype(np.float32)
    return {"JOINTS_0": file.add(np.where(weight > 0, index, 0).astype("u1"), ARRAY_BUFFER),
            "WEIGHTS_0": file.add(weight, ARRAY_BUFFER)}


def _targets(file: _Buffer, avatar: RiggedAvatar) -> list[dict[str, int]]:
    """One sparse morph target for each expression."""
    spans = [slice(a, b) for a, b in zip(avatar.expression_start, avatar.expression_start[1:], strict=False)]
    return [{"POSITION": file.add_sparse(len(avatar.vertices), avatar.expression_vertex[span], avatar.expression_delta[span])}
            for span in spans]


def _animation(file: _Buffer, name: str, clip: Animation, avatar: RiggedAvatar, rest: list[float], root: int) -> dict:
    """A glTF animation; a looping one ends with its first key."""
    closed = [*range(len(clip.rotation)), *([0] if clip.loop else [])]
    times = file.add((np.arange(len(closed)) / clip.fps).astype("<f4"), bounds=True)
    samplers, channels = [], []

    def track(node: int, path: str, values: np.ndarray) -> None:
        samplers.append({"input": times, "output": file.add(values.astype("<f4"))})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

    for j, joint in enumerate(clip.joints):
        quats = Rotation.from_rotvec(clip.rotation[closed, j]).as_quat()
        track(avatar.joint_names.index(joint), "rotation", np.where(quats[:, 3:] < 0, -quats, quats))
    track(root, "translation", clip.transl[closed] + np.asarray(rest))
    return {"name": name, "samplers": samplers, "channels": channels}


class _Buffer:
    """The binary chunk and its accessors, filled in order."""

    def __init__(self) -> None:
        self.data, self.views, self.accessors = bytearray(), [], []

    def add(self, array: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """array: (n,) or (n, width). Returns the accessor's index."""
        array = np.ascontiguousarray(array)
        width = 1 if array.ndim == 1 else array.shape[1]
        view = self._view(array)
        self.views[view] |= {"target": target} if target else {}
        accessor = {"bufferView": view, "componentType": CODES[array.dtype], "count": len(array),
                    "type": KINDS[width]}
        if bounds:
            flat = array.reshape(len(array), width)
            accessor |= {"min": flat.min(0).tolist(), "max": flat.max(0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_sparse(self, count: int, rows: np.ndarray, values: np.ndarray) -> int:
        """(count, 3) float32, zero but for values (n, 3) at rows (n,). Returns the accessor's index."""
        order = np.argsort(rows)
        rows, values = rows[order].astype("<u2" if count <= 1 << 16 else "<u4"), values[order].astype("<f4")
        accessor = {"componentType": FLOAT, "count": count, "type": "VEC3"}
        held = np.vstack([values, np.zeros((int(count > len(rows)), 3), "<f4")])
        accessor |= {"min": held.min(0).tolist(), "max": held.max(0).tolist()}
        if len(rows):
            accessor["sparse"] = {"count": len(rows), "values": {"bufferView": self._view(values)},
                                  "indices": {"bufferView": self._view(rows), "componentType": CODES[rows.dtype]}}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def _view(self, array: np.ndarray) -> int:
        """The array's bytes as a bufferView without a target."""
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes})
        self.data += array.tobytes()
        self.data += b"\0" * (-len(self.data) % 4)
        return len(self.views) - 1

    def glb(self, document: dict) -> bytes:
        document = document | {"buffers": [{"byteLength": len(self.data)}], "bufferViews": self.views,
                               "accessors": self.accessors}
        text = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self.data)
        return (struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") + text
                + struct.pack("<I4s", len(self.data), b"BIN\0") + bytes(self.data))
