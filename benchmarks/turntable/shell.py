"""Garments and hair: pieces of the body's surface, cut along a field and lifted off the skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse


@dataclass
class Shell:
    """N vertices, each on an edge (or a corner) of the body's mesh."""

    material: str
    rest: np.ndarray
    """(V, 3) m, lifted T-pose of the whole body's vertices; only those that `pair` names matter."""
    pair: np.ndarray
    """(N, 2) body vertices."""
    share: np.ndarray
    """(N,) of the second."""
    faces: np.ndarray
    """(F, 3) into N."""


def cut(faces: np.ndarray, field: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keeps the part of a mesh where field (V,) > 0, clipped at the zero line. Returns pair (N, 2), share (N,), faces."""
    inside = field[faces] > 0
    count = inside.sum(1)
    whole = faces[count == 3]
    one, two = faces[count == 1], faces[count == 2]
    one = _turned(one, inside[count == 1].argmax(1))
    two = _turned(two, (~inside[count == 2]).argmax(1))
    a, b, c = one.T
    o, p, q = two.T
    corner = lambda i: np.stack([i, i], -1)  # noqa: E731
    edge = lambda i, j: np.stack([i, j], -1)  # noqa: E731
    triangles = np.concatenate([
        np.stack([corner(whole[:, k]) for k in range(3)], 1),
        np.stack([corner(a), edge(a, b), edge(a, c)], 1),
        np.stack([edge(p, o), corner(p), corner(q)], 1),
        np.stack([edge(p, o), corner(q), edge(q, o)], 1),
    ])
    pairs = np.sort(triangles.reshape(-1, 2), 1)
    pair, inverse = np.unique(pairs, axis=0, return_inverse=True)
    g0, g1 = field[pair[:, 0]], field[pair[:, 1]]
    same = pair[:, 0] == pair[:, 1]
    share = np.where(same, 0.0, g0 / np.where(same, 1.0, g0 - g1))
    return pair, share, inverse.reshape(-1, 3)


def lifted(rest: np.ndarray, faces: np.ndarray, member: np.ndarray, thickness: np.ndarray, rounds: int,
           gap: float = 0.003) -> np.ndarray:
    """The body's surface, smoothed where `member` (V,) bool, then raised along its normal by thickness (V,) m.

    No vertex comes nearer to the skin than `gap` m. Returns (V, 3).
    """
    neighbours = adjacency(faces, len(rest))
    keep = sparse.diags(member.astype(float)) @ neighbours @ sparse.diags(member.astype(float))
    degree = np.asarray(keep.sum(1)).ravel()
    mean = sparse.diags(1 / np.maximum(degree, 1)) @ keep
    smooth = rest.astype(float).copy()
    for _ in range(rounds):
        smooth = np.where((degree > 0)[:, None], 0.4 * smooth + 0.6 * (mean @ smooth), smooth)
    normals = vertex_normals(rest, faces)
    out = smooth + vertex_normals(smooth, faces) * thickness[:, None]
    height = ((out - rest) * normals).sum(1)
    out += normals * np.maximum(gap - height, 0)[:, None]
    return np.where(member[:, None], out, rest)


def adjacency(faces: np.ndarray, count: int) -> sparse.csr_matrix:
    """(V, V) ones between neighbours."""
    i = faces[:, [0, 1, 2, 1, 2, 0]].ravel()
    j = faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    a = sparse.csr_matrix((np.ones(len(i)), (i, j)), (count, count))
    a.data[:] = 1
    return a


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) unit, weighted by area; 0 where a vertex has no face."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    out = np.stack([np.bincount(faces.ravel(), np.repeat(n[:, k], 3), len(vertices)) for k in range(3)], -1)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


def _turned(faces, first):
    """Each face's corners rotated so that corner `first` comes first."""
    rows = np.arange(len(faces))[:, None]
    return faces[rows, (first[:, None] + np.arange(3)) % 3]
