"""Packs an avatar into the buffers that the package uploads once; the C# loader does the same, and a test holds both equal."""

from __future__ import annotations

import numpy as np

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.rotation import to_xyzw


def pack_avatar(avatar: RiggedAvatar) -> dict[str, np.ndarray]:
    """Buffer of Gsac.compute -> array: V or V + 1 vertices (V, 4), M moves (M, 4), N gaussians (N, 4) or (N, 3, 4)."""
    V, M = len(avatar.vertices), len(avatar.expression_vertex)
    which = np.repeat(np.arange(len(avatar.expression_names)), np.diff(avatar.expression_start))
    order = np.lexsort((which, avatar.expression_vertex))
    first = np.searchsorted(avatar.expression_vertex[order], np.arange(V + 1))
    moves = np.concatenate([avatar.expression_delta, which[:, None]], 1).astype(np.float32)[order].reshape(M, 4)
    weight = np.rint(avatar.skin_weight * 65535).astype(np.uint32)
    index = avatar.skin_index.astype(np.uint32)
    skin = np.zeros((V + 1, 4), np.uint32)
    skin[:V, 0] = index[:, 0] | index[:, 1] << 8 | index[:, 2] << 16 | index[:, 3] << 24
    skin[:V, 1], skin[:V, 2] = weight[:, 0] | weight[:, 1] << 16, weight[:, 2] | weight[:, 3] << 16
    skin[:, 3] = first
    g = avatar.gaussians
    N = len(g)
    corners = np.zeros((N, 4), np.uint32)
    corners[:, :3] = avatar.faces[g.face]
    local = np.zeros((N, 3, 4), np.float32)
    quat = g.quat / np.linalg.norm(g.quat.astype(np.float64), axis=1, keepdims=True)
    local[:, 0, :3], local[:, 1], local[:, 2, :3] = g.mu, to_xyzw(quat), np.exp(g.log_scale)
    return {
        "GsacRest": np.concatenate([avatar.vertices, np.ones((V, 1), np.float32)], 1), "GsacSkin": skin, "GsacMoves": moves,
        "GsacCorners": corners, "GsacLocal": local,
        "GsacColours": np.concatenate([g.rgb, g.opacity[:, None]], 1).astype(np.float32),
    }
