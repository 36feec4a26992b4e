"""From an avatar to the bytes of its `.gsac` file (docs/gsac-format.md)."""

from __future__ import annotations

import numpy as np

from gsac.avatar import draw_rule
from gsac.avatar.gsac_file.container import pack
from gsac.avatar.gsac_file.rigged import RiggedAvatar

UNIT = 65535
SKIN_SCALE = 1 / UNIT
QUAT_SCALE = 1 / 32767
LOG_SCALE_SCALE = 1 / 2048
ALPHAS = {"alpha_max": draw_rule.MAX_ALPHA, "alpha_min": draw_rule.MIN_ALPHA}
"""The draw rule's bounds of alpha under the file's names."""


def avatar_bytes(avatar: RiggedAvatar) -> bytes:
    """The whole file; the same avatar gives the same bytes."""
    vertex_type = np.uint16 if len(avatar.vertices) <= 1 << 16 else np.uint32
    face_type = np.uint16 if len(avatar.faces) <= 1 << 16 else np.uint32
    blocks = {
        "rest.vertices": avatar.vertices.astype(np.float32),
        "rest.faces": avatar.faces.astype(vertex_type),
        "rest.joints": avatar.joints.astype(np.float32),
        "skin.index": avatar.skin_index.astype(np.uint8),
        "skin.weight": _weights_u16(avatar.skin_weight),
        "expression.start": avatar.expression_start.astype(np.uint32),
        "expression.vertex": avatar.expression_vertex.astype(vertex_type),
        "expression.delta": avatar.expression_delta.astype(np.float16),
        "expression.jaw": avatar.jaw_actions.astype(np.float32),
    }
    scales, levels, clips = {"skin.weight": SKIN_SCALE}, [], []
    for n, g in enumerate([avatar.gaussians, *avatar.coarser]):
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
        levels.append({"prefix": prefix, "count": len(g)} | ({} if g.max_height_px is None else {"max_height_px": g.max_height_px}))
    if avatar.gaussians.light is not None:
        blocks["light"] = avatar.gaussians.light.astype(np.float32)
    if avatar.correctives is not None:
        blocks |= {
            "corrective.start": avatar.correctives.start.astype(np.uint32),
            "corrective.joint": avatar.correctives.joint.astype(np.uint8),
            "corrective.delta": avatar.correctives.delta.astype(np.float16),
        }
    for name, clip in avatar.clips.items():
        blocks[f"clip.{name}.rotation"] = clip.rotation.astype(np.float32)
        blocks[f"clip.{name}.transl"] = clip.transl.astype(np.float32)
        clips.append({"name": name, "fps": clip.fps, "loop": clip.loop, "joints": clip.joints})
    head = {
        "format": "gsac", "axes": "right-handed, metres, y up, facing +z, left +x", "ground": avatar.ground,
        "joints": {"names": avatar.joint_names, "parents": avatar.parents.tolist()},
        "expressions": avatar.expression_names, "poses": avatar.poses, "clips": clips, "blend": blend_of(avatar.gaussians.low_pass),
        "levels": levels, "licence": avatar.licence, "provenance": avatar.provenance,
    }
    return pack(head, blocks, scales)


def blend_of(low_pass: draw_rule.LowPass) -> dict[str, float | bool]:
    """The draw rule under the file's names."""
    return {"low_pass_px2": low_pass.px2, "low_pass_energy": low_pass.keeps_energy, **ALPHAS}


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
