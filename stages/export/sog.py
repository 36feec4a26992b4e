"""`avatar.sog`: the posed gaussians in PlayCanvas' format, version 2: pictures of 8-bit numbers, a fifth of the PLY.

A zip, not packed further, of `meta.json` and lossless WebP pictures in which a gaussian is a pixel: positions as 16 bits of their
logarithm, rotation as the three smaller components, scales and colours as places in a table of 256 values (format:
developer.playcanvas.com, *The SOG format*). Axes as in avatar.ply.
"""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np

from gsac.avatar.zip_member import undated
from gsac.stages.export.ply import MIN_SCALE, SH0, turn_about_x

VERSION = 2
TABLE = 256
ROUNDS = 10
"""Of Lloyd's algorithm, which fits a table to its values."""
LARGEST = 252
"""Alpha of a rotation whose first component, of wxyz, is the largest."""
CELL_BITS = 10
"""Of each coordinate, for the order of the gaussians."""


def sog_bytes(means: np.ndarray, quats: np.ndarray, scales: np.ndarray, rgb: np.ndarray, opacity: np.ndarray) -> bytes:
    """The file's bytes; the same input gives the same bytes.

    means (N, 3) m, quats (N, 4) wxyz, scales (N, 3) m: in canonical axes; rgb (N, 3) and opacity (N,) in 0..1.
    """
    order = order_by_nearness(means)
    places = (means * (1, -1, -1)).astype(np.float64)[order]
    places = np.sign(places) * np.log1p(np.abs(places))
    low, high = places.min(0), places.max(0)
    fixed = np.rint((places - low) / np.maximum(high - low, 1e-9) * 65535).astype(np.int64)
    scale_table, scale_index = choose_table(np.log(np.maximum(scales[order], MIN_SCALE)))
    colour_table, colour_index = choose_table((rgb[order] - 0.5) / SH0)
    opaque = np.full(len(means), 255)
    pictures = {
        "means_l.webp": np.column_stack([fixed & 255, opaque]), "means_u.webp": np.column_stack([fixed >> 8, opaque]),
        "quats.webp": pack_rotations(turn_about_x(quats[order])), "scales.webp": np.column_stack([scale_index, opaque]),
        "sh0.webp": np.column_stack([colour_index, np.rint(np.clip(opacity[order], 0, 1) * 255).astype(int)]),
    }
    meta = {
        "version": VERSION, "asset": {"generator": "gsac"}, "count": len(means), "antialias": False,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": scale_table.tolist(), "files": ["scales.webp"]}, "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": colour_table.tolist(), "files": ["sh0.webp"]},
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in (("meta.json", json.dumps(meta).encode()), *((n, _webp(p)) for n, p in pictures.items())):
            archive.writestr(undated(name), content)
    return file.getvalue()


def order_by_nearness(means: np.ndarray) -> np.ndarray:
    """(N,) order in which neighbours lie side by side, so that the pictures pack better: Morton's. means: (N, 3) m."""
    low, high = means.min(0), means.max(0)
    cell = ((means - low) / np.maximum(high - low, 1e-9) * (2 ** CELL_BITS - 1)).astype(np.int64)
    bits = [((cell[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(CELL_BITS) for axis in range(3)]
    return np.argsort(np.sum(bits, axis=0), kind="stable")


def choose_table(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """values: (N, 3). Returns a table (256,) float64, ascending, and the place of each value's nearest in it, (N, 3) int.

    Starts from quantiles, so that no entry is idle, and moves each entry to the mean of the values that it stands for.
    """
    flat = np.sort(values.astype(np.float64).ravel())
    table = np.quantile(flat, (np.arange(TABLE) + 0.5) / TABLE)
    for _ in range(ROUNDS):
        ends = np.searchsorted(flat, (table[1:] + table[:-1]) / 2)
        count = np.diff(ends, prepend=0, append=len(flat))
        total = np.diff(np.append(0, np.cumsum(flat))[ends], prepend=0, append=flat.sum())
        table = np.sort(np.where(count > 0, total / np.maximum(count, 1), table))
    return table, np.searchsorted((table[1:] + table[:-1]) / 2, values)


def pack_rotations(quats: np.ndarray) -> np.ndarray:
    """quats: (N, 4) wxyz. Returns (N, 4) int: the three smaller components in order, and which one is the largest."""
    rows, largest = np.arange(len(quats)), np.abs(quats).argmax(1)
    quats = quats / np.linalg.norm(quats, axis=1, keepdims=True) * np.where(quats[rows, largest] < 0, -1, 1)[:, None]
    others = np.array([[i for i in range(4) if i != k] for k in range(4)])[largest]
    smaller = np.take_along_axis(quats, others, axis=1) * np.sqrt(2)
    return np.column_stack([np.clip(np.rint((smaller * 0.5 + 0.5) * 255), 0, 255).astype(int), LARGEST + largest])


def _webp(pixels: np.ndarray) -> bytes:
    """pixels: (N, 4) in 0..255. A lossless picture, as square as can be."""
    from PIL import Image

    width = int(np.ceil(np.sqrt(len(pixels))))
    canvas = np.zeros((-(-len(pixels) // width) * width, 4), np.uint8)
    canvas[:len(pixels)] = pixels
    file = io.BytesIO()
    Image.fromarray(canvas.reshape(-1, width, 4)).save(file, "WEBP", lossless=True, exact=True, quality=100)
    return file.getvalue()
