"""The skinned, textured, animated mesh of glTF files: 55 joints with identity rest rotations, at most 4 weights a vertex, y up,
facing +z, feet at y = 0; expressions are morph targets by their ARKit names.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.gltf_file import ARRAY_BUFFER, ELEMENT_BUFFER, GltfFile
from gsac.stages.export.texture import Surface

TRIANGLES = 4
LINEAR, MIPMAPS, CLAMP = 9729, 9987, 33071


def body_document(file: GltfFile, avatar: RiggedAvatar, surface: Surface) -> dict:
    """A document that shows the body: nodes are the joints in order, then the mesh; its arrays and picture go into the file."""
    J = len(avatar.joints)
    joints = avatar.joints - np.array([0, avatar.ground, 0], np.float32)
    inverse = np.tile(np.eye(4, dtype=np.float32), (J, 1, 1))
    inverse[:, 3, :3] = -joints
    nodes = []
    for j, (name, parent) in enumerate(zip(avatar.joint_names, avatar.parents, strict=True)):
        node = {"name": name, "translation": (joints[j] - (joints[parent] if parent >= 0 else 0)).tolist()}
        children = np.flatnonzero(avatar.parents == j).tolist()
        nodes.append(node | ({"children": children} if children else {}))
    root = int(np.flatnonzero(avatar.parents < 0)[0])
    document = {
        "asset": head_of(avatar),
        "scene": 0, "scenes": [{"name": "avatar", "nodes": [root, J]}],
        "nodes": [*nodes, {"name": "body", "mesh": 0, "skin": 0}], "meshes": [_mesh(file, avatar, surface)],
        "skins": [{"joints": list(range(J)), "skeleton": root, "inverseBindMatrices": file.add(inverse.reshape(J, 16))}],
        "materials": [{"name": "body", "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.9}}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": LINEAR, "minFilter": MIPMAPS, "wrapS": CLAMP, "wrapT": CLAMP}],
        "images": [{"name": "body", "mimeType": "image/jpeg", "bufferView": file.add_bytes(surface.jpeg)}],
    }
    if avatar.clips:
        document["animations"] = [_animation(file, name, clip, avatar, nodes[root]["translation"], root)
                                  for name, clip in avatar.clips.items()]
    return document


def head_of(avatar: RiggedAvatar) -> dict[str, str]:
    """What a glTF file says of itself."""
    return {"version": "2.0", "generator": "gsac", "copyright": "; ".join(avatar.licence.values())}


def _mesh(file: GltfFile, avatar: RiggedAvatar, surface: Surface) -> dict:
    index, weight = avatar.skin_index[surface.vertex], avatar.skin_weight[surface.vertex]
    weight = (weight / weight.sum(1, keepdims=True)).astype(np.float32)
    primitive = {
        "mode": TRIANGLES, "material": 0, "indices": file.add(surface.faces.reshape(-1).astype("<u4"), ELEMENT_BUFFER),
        "attributes": {
            "POSITION": file.add(surface.positions, ARRAY_BUFFER, bounds=True),
            "NORMAL": file.add(surface.normals, ARRAY_BUFFER),
            "TEXCOORD_0": file.add(surface.uv, ARRAY_BUFFER),
            # The validator demands joint 0 where there is no weight.
            "JOINTS_0": file.add(np.where(weight > 0, index, 0).astype("u1"), ARRAY_BUFFER),
            "WEIGHTS_0": file.add(weight, ARRAY_BUFFER),
        }}
    if not avatar.expression_names:
        return {"name": "body", "primitives": [primitive]}
    primitive["targets"] = _targets(file, avatar, surface.vertex)
    return {"name": "body", "primitives": [primitive], "weights": [0.0] * len(avatar.expression_names),
            "extras": {"targetNames": avatar.expression_names}}


def _targets(file: GltfFile, avatar: RiggedAvatar, vertex: np.ndarray) -> list[dict[str, int]]:
    """One sparse morph target for each expression. vertex: (W,) of the body, that each of the mesh is."""
    place = np.full(len(avatar.vertices), -1)
    targets = []
    for start, end in zip(avatar.expression_start, avatar.expression_start[1:], strict=False):
        place[avatar.expression_vertex[start:end]] = np.arange(start, end)
        row = place[vertex]
        moved = np.flatnonzero(row >= 0)
        targets.append({"POSITION": file.add_sparse(len(vertex), moved, avatar.expression_delta[row[moved]])})
        place[avatar.expression_vertex[start:end]] = -1
    return targets


def _animation(file: GltfFile, name: str, clip: Animation, avatar: RiggedAvatar, rest: list[float], root: int) -> dict:
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
