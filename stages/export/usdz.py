"""`avatar.usdz`, for Quick Look on iPhone, iPad and Mac: the skinned, textured mesh, moving as the first clip does.

A zip, not packed further, whose files begin at multiples of 64 bytes: a text layer (USDA) and the picture. Metres, y up, facing +z,
feet at y = 0. USD cannot hold more than one motion of a skeleton; expressions are left out, which Quick Look would not show.
"""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.rotation import to_wxyz
from gsac.avatar.zip_member import undated
from gsac.stages.export.texture import Surface

LAYER, PICTURE = "avatar.usda", "body.jpg"
ALIGNED = 64
"""Bytes; a reader maps the zip's files into memory as they are."""
HEADER = 30
"""Bytes of a zip's head of a file, before its name and extra field."""
PADDING = 0x1986
"""Id of the extra field that holds nothing, which USD's own writer uses."""

SCENE = """#usda 1.0
(
    customLayerData = {{ string copyright = {copyright} }}
    defaultPrim = "avatar"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 0
    endTimeCode = {end}
    timeCodesPerSecond = {fps}
    framesPerSecond = {fps}
)

def SkelRoot "avatar" (
    kind = "component"
)
{{
    float3[] extent = {extent}

    def Skeleton "skeleton" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token[] joints = {paths}
        uniform matrix4d[] bindTransforms = {bind}
        uniform matrix4d[] restTransforms = {rest}
        rel skel:animationSource = </avatar/skeleton/motion>

        def SkelAnimation "motion"
        {{
            uniform token[] joints = {paths}
            float3[] translations.timeSamples = {{ {translations} }}
            quatf[] rotations.timeSamples = {{ {rotations} }}
            half3[] scales = {scales}
        }}
    }}

    def Mesh "body" (
        prepend apiSchemas = ["SkelBindingAPI", "MaterialBindingAPI"]
    )
    {{
        uniform token subdivisionScheme = "none"
        float3[] extent = {extent}
        int[] faceVertexCounts = {counts}
        int[] faceVertexIndices = {corners}
        point3f[] points = {points}
        normal3f[] normals = {normals} (
            interpolation = "vertex"
        )
        texCoord2f[] primvars:st = {uv} (
            interpolation = "vertex"
        )
        matrix4d primvars:skel:geomBindTransform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
        int[] primvars:skel:jointIndices = {joint_index} (
            elementSize = 4
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = {joint_weight} (
            elementSize = 4
            interpolation = "vertex"
        )
        rel skel:skeleton = </avatar/skeleton>
        rel material:binding = </avatar/material>
    }}

    def Material "material"
    {{
        token outputs:surface.connect = </avatar/material/surface.outputs:surface>

        def Shader "surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </avatar/material/picture.outputs:rgb>
            float inputs:metallic = 0
            float inputs:roughness = 0.9
            token outputs:surface
        }}

        def Shader "picture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{picture}@
            token inputs:sourceColorSpace = "sRGB"
            float2 inputs:st.connect = </avatar/material/coordinates.outputs:result>
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float3 outputs:rgb
        }}

        def Shader "coordinates"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
}}
"""


def usdz_bytes(avatar: RiggedAvatar, surface: Surface) -> bytes:
    """The file's bytes; the same input gives the same bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in ((LAYER, layer_text(avatar, surface).encode()), (PICTURE, surface.jpeg)):
            info = undated(name)
            start = file.tell() + HEADER + len(name.encode()) + 4
            gap = -start % ALIGNED
            info.extra = PADDING.to_bytes(2, "little") + gap.to_bytes(2, "little") + b"\0" * gap
            archive.writestr(info, content)
    return file.getvalue()


def layer_text(avatar: RiggedAvatar, surface: Surface) -> str:
    """The scene as USD's text."""
    joints = avatar.joints - np.array([0, avatar.ground, 0], np.float32)
    local = np.where(avatar.parents[:, None] >= 0, joints - joints[avatar.parents], joints)
    paths: list[str] = []
    for name, parent in zip(avatar.joint_names, avatar.parents, strict=True):
        paths.append(f"{paths[parent]}/{name}" if parent >= 0 else name)
    fps, rotation, moved = find_motion(avatar)
    places = np.repeat(local[None], len(moved), axis=0)
    places[:, avatar.parents < 0] += moved[:, None]
    quats = to_wxyz(Rotation.from_rotvec(rotation.reshape(-1, 3)).as_quat()).reshape(*rotation.shape[:2], 4)
    weight = avatar.skin_weight[surface.vertex]
    return SCENE.format(
        copyright=json.dumps("; ".join(avatar.licence.values()), ensure_ascii=False), fps=f"{fps:g}", end=len(moved) - 1,
        extent=_rows(np.stack([surface.positions.min(0), surface.positions.max(0)])),
        paths=f"[{', '.join(map(json.dumps, paths))}]", bind=_matrices(joints), rest=_matrices(local),
        translations=_samples(places), rotations=_samples(quats), scales=_rows(np.ones_like(joints)),
        counts=_numbers(np.full(len(surface.faces), 3)), corners=_numbers(surface.faces.ravel()),
        points=_rows(surface.positions), normals=_rows(surface.normals), uv=_rows(surface.uv * (1, -1) + (0, 1)),
        joint_index=_numbers(avatar.skin_index[surface.vertex].ravel()),
        joint_weight=_numbers((weight / weight.sum(1, keepdims=True)).ravel()), picture=PICTURE)


def find_motion(avatar: RiggedAvatar) -> tuple[float, np.ndarray, np.ndarray]:
    """The first clip, closed if it loops, or one key at rest: keys a second, rotations (K, J, 3) axis-angle, ways (K, 3) m."""
    if not avatar.clips:
        return 30.0, np.zeros((1, len(avatar.joints), 3)), np.zeros((1, 3))
    clip = next(iter(avatar.clips.values()))
    closed = [*range(len(clip.rotation)), *([0] if clip.loop else [])]
    rotation = np.zeros((len(closed), len(avatar.joints), 3))
    rotation[:, [avatar.joint_names.index(name) for name in clip.joints]] = clip.rotation[closed]
    return clip.fps, rotation, clip.transl[closed]


def _matrices(places: np.ndarray) -> str:
    """Translations as USD writes them, which multiplies rows. places: (J, 3)."""
    return f"[{', '.join(f'((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), ({x:.6f}, {y:.6f}, {z:.6f}, 1))' for x, y, z in places)}]"


def _samples(values: np.ndarray) -> str:
    """values: (K, n, width) of the time codes 0, 1, 2 ..."""
    return ", ".join(f"{k}: {_rows(rows)}" for k, rows in enumerate(values))


def _rows(values: np.ndarray) -> str:
    """values: (n, width)."""
    pattern = f"({', '.join(['%.6g'] * values.shape[1])})"
    return f"[{', '.join([pattern] * len(values)) % tuple(values.ravel().tolist())}]"


def _numbers(values: np.ndarray) -> str:
    """values: (n,)."""
    return f"[{', '.join(['%.6g'] * len(values)) % tuple(values.tolist())}]"
