"""`avatar.spz`: the posed gaussians in Niantic's compressed splat format, version 3, a sixth of the PLY.

Axes are right, up, back, which are the canonical ones: y up, the person faces +z. Gzipped: a header of 16 bytes, then one array
after the other: positions in 24-bit fixed point, opacity, colour, logarithm of the scale in steps of 1/16, and the rotation's
three smaller components with 9 bits and a sign each (format: github.com/nianticlabs/spz, MIT). Version 3, because more programs
read it than version 4; PlayCanvas' own parser needs 4, into which splat-transform converts it.
"""

from __future__ import annotations

import gzip
import struct

import numpy as np

from gsac.avatar.rotation import to_xyzw
from gsac.stages.export.ply import MIN_SCALE, SH0

HEADER = struct.Struct("<IIIBBBB")
MAGIC, VERSION = 0x5053474E, 3
FRACTION_BITS = 16
"""Positions in steps of 2^-16 m; up to 128 m from the origin."""
COLOUR = 0.15
"""Share of the byte's range for one unit of the degree-0 harmonic."""
ROTATION_STEPS = 511


def spz_bytes(means: np.ndarray, quats: np.ndarray, scales: np.ndarray, rgb: np.ndarray, opacity: np.ndarray) -> bytes:
    """The file's bytes; the same input gives the same bytes.

    means (N, 3) m, quats (N, 4) wxyz, scales (N, 3) m: in canonical axes; rgb (N, 3) and opacity (N,) in 0..1.
    """
    fixed = np.rint(means.astype(np.float64) * 2 ** FRACTION_BITS).astype("<i4")
    parts = [
        np.ascontiguousarray(fixed).view(np.uint8).reshape(-1, 3, 4)[:, :, :3],
        _byte(opacity * 255),
        _byte((rgb - 0.5) / SH0 * (COLOUR * 255) + 127.5),
        _byte((np.log(np.maximum(scales, MIN_SCALE)) + 10) * 16),
        pack_smallest_three(quats),
    ]
    head = HEADER.pack(MAGIC, VERSION, len(means), 0, FRACTION_BITS, 0, 0)
    return gzip.compress(head + b"".join(np.ascontiguousarray(part).tobytes() for part in parts), 9, mtime=0)


def pack_smallest_three(quats: np.ndarray) -> np.ndarray:
    """quats: (N, 4) wxyz. Returns (N,) little-endian 32-bit words: the index of the largest of x, y, z, w, then the others in
    order."""
    xyzw = to_xyzw(quats).astype(np.float64)
    xyzw /= np.linalg.norm(xyzw, axis=1, keepdims=True)
    rows, largest = np.arange(len(xyzw)), np.abs(xyzw).argmax(1)
    xyzw *= np.where(xyzw[rows, largest] < 0, -1, 1)[:, None]
    word = largest.astype(np.uint32)
    for i in range(4):
        steps = np.rint(np.abs(xyzw[:, i]) * np.sqrt(2) * ROTATION_STEPS).astype(np.uint32)
        bits = np.minimum(steps, ROTATION_STEPS) | (xyzw[:, i] < 0).astype(np.uint32) << 9
        word = np.where(largest == i, word, word << 10 | bits)
    return word.astype("<u4")


def _byte(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)
