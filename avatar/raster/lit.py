"""The room's light on the faces that carry gaussians, in one pass: `light.shade` of their normals, which takes them gathered."""

from __future__ import annotations

import numpy as np

from gsac.avatar.draw_rule import BRIGHTEST, DARKEST
from gsac.avatar.light import TERMS
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.threads import Workspace


def shade_faces(light: np.ndarray, R: np.ndarray, face: np.ndarray, workspace: Workspace) -> np.ndarray:
    """(N, 3) factors of the colours. light: (TERMS, 3); R: (F, 3, 3) of the faces' frames in the camera's axes; face: (N,)."""
    terms = workspace.take("light_terms", (len(face), TERMS), R.dtype)
    _basis(R, face, terms)
    out = terms @ light.astype(R.dtype)
    return np.clip(out, DARKEST, BRIGHTEST, out=out)


@own_kernel(nogil=True)
def _basis(R, face, terms):
    """terms (N, TERMS), written: `light.basis` of the faces' normals. R: (F, 3, 3); face: (N,)."""
    for i in range(len(face)):
        terms[i, 0] = 1
        terms[i, 1], terms[i, 2], terms[i, 3] = R[face[i], 0, 1], -R[face[i], 1, 1], abs(R[face[i], 2, 1])
