"""The jaw joint: anny has no bone for it, so its place and angle are estimated from the chin's motion under jawOpen."""

from __future__ import annotations

import sys

import anny
import numpy as np


def jaw_pivot(vertices: np.ndarray, opened: np.ndarray) -> np.ndarray:
    """Point (3,) m on the mid plane about which jawOpen rotates the chin (least squares, rotation about x).

    vertices: (V, 3) m; opened: (V, 3) m, displacement by jawOpen.
    """
    size = np.linalg.norm(opened, axis=1)
    chin = size > 0.8 * size.max()
    d, p = opened[chin][:, 1:], vertices[chin][:, 1:]
    # d = angle * perp(p - pivot): linear in (angle, angle * pivot)
    rows, want = [], []
    for (dy, dz), (y, z) in zip(d, p, strict=True):
        rows += [[-z, 1, 0], [y, 0, -1]]
        want += [dy, dz]
    angle, az, ay = np.linalg.lstsq(np.array(rows), np.array(want), rcond=None)[0]
    return np.array([0, ay / angle, az / angle])


def jaw_actions(model: anny.Anny, opened: np.ndarray, vertices: np.ndarray, jaw: np.ndarray) -> np.ndarray:
    """Facial actions (52, 3) that equal a jaw rotation of one radian about x, y, z.

    opened: (V, 3) m, displacement by jawOpen; vertices: (V, 3) m; jaw: (3,) m, of `jaw_pivot`.
    """
    size = np.linalg.norm(opened, axis=1)
    chin = size.argmax()
    angle = size[chin] / np.linalg.norm((vertices[chin] - jaw)[1:])
    names = model.facial_action_labels
    out = np.zeros((52, 3), np.float32)
    out[names.index("jawOpen"), 0] = 1 / angle
    print(f"jaw at {jaw.round(3)}, jawOpen turns it {np.degrees(angle):.1f} degrees", file=sys.stderr)
    return out
