"""Garments and hair: pieces of the body's surface, cut along a scalar field and raised off the skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import ConvexHull

from gsac.avatar.mesh import vertex_normals


@dataclass
class Shell:
    """A mesh of N vertices, each on an edge or at a vertex of the body's mesh."""

    material: str
    """One of `person.MATERIALS`."""
    rest: np.ndarray
    """(V, 3) m, raised surface in the T-pose, over all of the body's vertices; only those in `pair` are used."""
    pair: np.ndarray
    """(N, 2) body vertices."""
    share: np.ndarray
    """(N,) weight of the second of the pair."""
    faces: np.ndarray
    """(F, 3) into N."""
    paint: np.ndarray
    """(V, 3) m, texture coordinates."""


@dataclass
class Piece:
    """A mesh of its own, of M vertices that follow joints."""

    material: str
    """One of `person.MATERIALS`."""
    rest: np.ndarray
    """(M, 3) m, T-pose."""
    faces: np.ndarray
    """(F, 3) into M."""
    paint: np.ndarray
    """(M, 3), texture coordinates."""
    skin_index: np.ndarray
    """(M, 4) joints of the skinning weights."""
    skin_weight: np.ndarray
    """(M, 4)."""


def cut_mesh(faces: np.ndarray, field: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keeps the part of a mesh with a positive field, cut at the zero line.

    faces: (F, 3); field: (V,). Returns pair (N, 2) of vertices, share (N,) of the second, and faces (G, 3) into N.
    """
    inside = field[faces] > 0
    count = inside.sum(1)
    whole = faces[count == 3]
    one, two = faces[count == 1], faces[count == 2]
    one = _rotate_corners(one, inside[count == 1].argmax(1))
    two = _rotate_corners(two, (~inside[count == 2]).argmax(1))
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


def raise_surface(rest: np.ndarray, faces: np.ndarray, member: np.ndarray, thickness: np.ndarray, rounds: int,
                  gap: float = 0.003) -> np.ndarray:
    """Raises the member vertices by a thickness over a smoothed copy of the body.

    rest: (V, 3) m; faces: (F, 3); member: (V,) bool; thickness: (V,) m; rounds: of smoothing; gap: least m to the skin.
    Vertices move along the smoothed normals only, which keeps patterns in place. Smoothing is Taubin's (1995), without shrinkage.
    Returns (V, 3) m.
    """
    share = sparse.diags(member.astype(float))
    keep = share @ adjacency(faces, len(rest)) @ share
    degree = np.asarray(keep.sum(1)).ravel()
    mean = sparse.diags(1 / np.maximum(degree, 1)) @ keep
    smooth = rest.astype(float).copy()
    for k in range(2 * rounds):
        pull = mean @ smooth - smooth
        smooth += np.where((degree > 0)[:, None], (0.6 if k % 2 == 0 else -0.62) * pull, 0)
    along = vertex_normals(smooth, faces)
    out = rest + along * (((smooth - rest) * along).sum(1) + thickness)[:, None]
    normals = vertex_normals(rest, faces)
    height = ((out - rest) * normals).sum(1)
    out += normals * np.maximum(gap - height, 0)[:, None]
    return np.where(member[:, None], out, rest)


def drape(lift: np.ndarray, free: np.ndarray, slope: float = 0.3) -> np.ndarray:
    """Lets cloth hang: below a bulge its radius shrinks by at most `slope` m a metre of height.

    lift: (V, 3) m; free: (V,) 0..1, share of the effect. Radii are taken about the vertical axis through the free vertices' mean,
    in 48 sectors and rows of 2 cm. Returns (V, 3) m.
    """
    here = free > 0
    middle = lift[here].mean(0)
    d = lift - middle
    radius, angle = np.hypot(d[:, 0], d[:, 2]), np.arctan2(d[:, 0], d[:, 2])
    top = lift[here, 1].max()
    row, sector = (top - lift[:, 1]) / 0.02, (angle / (2 * np.pi) * 48) % 48
    rows = int(row[here].max()) + 2
    reach = np.zeros((rows, 48))
    for dr in (0, 1):
        for ds in (0, 1):
            at = (np.clip(row[here].astype(int) + dr, 0, rows - 1), (sector[here].astype(int) + ds) % 48)
            np.maximum.at(reach, at, radius[here])
    for k in range(1, rows):
        fallen = (reach[k - 1] + np.roll(reach[k - 1], 1) + np.roll(reach[k - 1], -1)) / 3 - slope * 0.02
        reach[k] = np.maximum(reach[k], fallen)
    reach = sum(np.roll(reach, k, 1) for k in (-1, 0, 1)) / 3
    r0, s0 = np.clip(row.astype(int), 0, rows - 2), sector.astype(int) % 48
    u, v = np.clip(row - r0, 0, 1), sector - np.floor(sector)
    s1 = (s0 + 1) % 48
    want = (1 - u) * ((1 - v) * reach[r0, s0] + v * reach[r0, s1]) + u * (
        (1 - v) * reach[r0 + 1, s0] + v * reach[r0 + 1, s1])
    grow = np.clip(want / np.maximum(radius, 1e-6), 1, 2) - 1
    return lift + d * [1, 0, 1] * (grow * free)[:, None]


def pull_to_hull(points: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Moves points towards the convex hull of those with a positive share: toes become the cap of a shoe.

    points: (V, 3) m; share: (V,) 0..1 of the way. Returns (V, 3) m.
    """
    here = share > 0
    hull = ConvexHull(points[here])
    centre = points[here].mean(0)
    d = points - centre
    length = np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)
    d = d / length
    normals, offset = hull.equations[:, :3], hull.equations[:, 3]
    facing = d @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(facing > 1e-6, -(normals @ centre + offset) / facing, np.inf).min(1)
    return np.where(here[:, None], points + (centre + d * reach[:, None] - points) * share[:, None], points)


def adjacency(faces: np.ndarray, count: int) -> sparse.csr_matrix:
    """(V, V) with ones between neighbours, V = count. faces: (F, 3)."""
    i = faces[:, [0, 1, 2, 1, 2, 0]].ravel()
    j = faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    a = sparse.csr_matrix((np.ones(len(i)), (i, j)), (count, count))
    a.data[:] = 1
    return a


def _rotate_corners(faces, first):
    """Rotates each face's corners so that corner `first` comes first."""
    rows = np.arange(len(faces))[:, None]
    return faces[rows, (first[:, None] + np.arange(3)) % 3]
