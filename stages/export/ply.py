"""`avatar.ply`: the posed gaussians as a standard 3DGS PLY, which every splat viewer opens.

3DGS axes (x right, y down, z forward: the canonical axes turned by 180 degrees about x), metres, feet at y = 0; scales
as natural logarithm, colour as the degree-0 spherical harmonic, opacity as logit, rotation wxyz.
"""

from __future__ import annotations

import numpy as np

SH0 = 0.28209479177387814
"""Value of the degree-0 real spherical harmonic: rgb = 0.5 + SH0 * f_dc."""
MAX_LOGIT = 16.0
MIN_SCALE = 1e-7
"""m; a gaussian on a face without area has scale 0, which has no logarithm."""


def ply_bytes(means: np.ndarray, quats: np.ndarray, scales: np.ndarray, rgb: np.ndarray, opacity: np.ndarray,
              pad_sh: bool = False) -> bytes:
    """The file's bytes.

    means (N, 3) m, quats (N, 4) wxyz, scales (N, 3) m: in canonical axes, y up; rgb (N, 3) and opacity (N,) in 0..1.
    pad_sh: also write the 45 higher-degree coefficients, as zeros.
    """
    rest = [f"f_rest_{i}" for i in range(45)] if pad_sh else []
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity",
             "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    columns = {
        "x": (means * (1, -1, -1)).T, "f_dc_0": ((rgb - 0.5) / SH0).T, "opacity": logit(opacity)[None],
        "scale_0": np.log(np.maximum(scales, MIN_SCALE)).T, "rot_0": turn_about_x(quats).T,
    }
    table = np.zeros((len(means), len(names)), "<f4")
    for first, values in columns.items():
        at = names.index(first)
        table[:, at:at + len(values)] = values.T
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(means)}",
            *(f"property float {name}" for name in names), "end_header", ""]
    return "\n".join(head).encode() + table.tobytes()


def turn_about_x(quats: np.ndarray) -> np.ndarray:
    """quats: (N, 4) wxyz. Returns (N, 4) after a turn of 180 degrees about x; unit length, w >= 0."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    out = np.stack([-x, w, -z, y], axis=1)
    return np.where(out[:, :1] < 0, -out, out)


def logit(opacity: np.ndarray) -> np.ndarray:
    """opacity: (N,) in 0..1. Returns (N,), the inverse of the sigmoid; 0 and 1 become -16 and 16."""
    with np.errstate(divide="ignore"):
        value = np.log(opacity.astype(np.float64)) - np.log1p(-opacity.astype(np.float64))
    return np.clip(value, -MAX_LOGIT, MAX_LOGIT)
