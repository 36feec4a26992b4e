"""`avatar.glb`: a skinned, textured, animated mesh for any glTF tool, and the gaussians.

Mesh: as `gltf_body.py` has it.
Gaussians: a POINTS primitive in T-pose with KHR_gaussian_splatting (its release candidate: linear scales, opacities after the
sigmoid), each with the mesh face that it is bound to in `_GSAC_FACE`. No node shows this mesh, the last: PlayCanvas and Blender
show all scenes of a file, and splats, on which readers ignore a skin, would stand still in the moving body. A program takes them by
name, or from the file that has them alone.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.rotation import to_xyzw
from gsac.avatar.srgb import to_linear
from gsac.stages.export.gltf_body import body_document, head_of
from gsac.stages.export.gltf_file import ARRAY_BUFFER, GltfFile
from gsac.stages.export.ply import SH0
from gsac.stages.export.texture import Surface

POINTS = 0
SPLATS = "KHR_gaussian_splatting"


def glb_bytes(avatar: RiggedAvatar, surface: Surface, means: np.ndarray, quats: np.ndarray, scales: np.ndarray) -> bytes:
    """The file's bytes. means: (N, 3) m, quats: (N, 4) wxyz, scales: (N, 3) m, of the gaussians in T-pose, feet at y = 0."""
    file = GltfFile()
    document = body_document(file, avatar, surface)
    document["meshes"].append(_points(file, avatar.gaussians, means, quats, scales))
    return file.glb(document | {"extensionsUsed": [SPLATS]})


def splats_glb_bytes(avatar: RiggedAvatar, means: np.ndarray, quats: np.ndarray, scales: np.ndarray) -> bytes:
    """The bytes of a file that shows the gaussians alone. means: (N, 3) m, quats: (N, 4) wxyz, scales: (N, 3) m, feet at y = 0."""
    file = GltfFile()
    points = _points(file, avatar.gaussians, means, quats, scales)
    return file.glb({"asset": head_of(avatar), "extensionsUsed": [SPLATS], "scene": 0, "scenes": [{"name": "avatar", "nodes": [0]}],
                     "nodes": [{"name": "gaussians", "mesh": 0}], "meshes": [points]})


def _points(file: GltfFile, g: Gaussians, means: np.ndarray, quats: np.ndarray, scales: np.ndarray) -> dict:
    """The mesh of the gaussians, whose arrays go into the file."""
    rgb = to_linear(np.clip(g.rgb, 0, 1))  # glTF's COLOR_0 holds linear light
    return {"primitives": [{
        "mode": POINTS, "attributes": {
            "POSITION": file.add(means.astype("<f4"), ARRAY_BUFFER, bounds=True),
            "COLOR_0": file.add(np.column_stack([rgb, g.opacity]).astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:ROTATION": file.add(to_xyzw(quats).astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:SCALE": file.add(scales.astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:OPACITY": file.add(g.opacity.astype("<f4"), ARRAY_BUFFER),
            f"{SPLATS}:SH_DEGREE_0_COEF_0": file.add(((g.rgb - 0.5) / SH0).astype("<f4"), ARRAY_BUFFER),
            "_GSAC_FACE": file.add(g.face.astype("<f4"), ARRAY_BUFFER),
        }, "extensions": {SPLATS: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display",
                                   "projection": "perspective", "sortingMethod": "cameraDistance"}}}],
        "name": "gaussians"}
