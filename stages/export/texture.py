"""The mesh's picture: at each texel what the gaussians show to an eye that looks along the face's normal.

Vertex colours would do without coordinates, but many tools ignore them, and a mesh that has both is shown with the product.
"""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from gsac.avatar.camera import Camera
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.rotation import to_xyzw
from gsac.avatar.zbuffer import rasterise
from gsac.stages.export.unwrap import GUTTER, find_parts, unwrap

SIZE = 1024
"""Width and height, px."""
QUALITY = 88
"""Of the JPEG."""
NEAREST = 8
"""Number of gaussians that a vertex takes its colour from; a texel looks at those of its face's corners."""
BLUR_M = 0.004
"""Distance, m, below which gaussians count alike."""
LOW_PASS_M = 0.001
"""Standard deviation, m, that each gaussian gets at least, as on a screen."""
SPREAD = 9.0
"""Squared Mahalanobis distance at which a gaussian ends."""
MOST_ALPHA, LEFT = 0.999, 0.02
"""Of one gaussian; and the transmittance at which a texel is full."""


@dataclass(frozen=True)
class Surface:
    """The avatar's mesh in T-pose with its picture; W vertices, doubled where charts meet, of the body's V. Feet at y = 0."""

    vertex: np.ndarray
    """(W,) int32: the body's vertex that each is."""
    faces: np.ndarray
    """(F, 3) int32, into the W."""
    uv: np.ndarray
    """(W, 2) float32 in 0..1, from the picture's upper left corner."""
    positions: np.ndarray
    """(W, 3) float32, m."""
    normals: np.ndarray
    """(W, 3) float32, unit."""
    jpeg: bytes
    """The picture, sRGB."""


def paint_surface(avatar: RiggedAvatar, means: np.ndarray, quats: np.ndarray, scales: np.ndarray) -> Surface:
    """means: (N, 3) m, quats: (N, 4) wxyz, scales: (N, 3) m: the gaussians in T-pose, feet at y = 0."""
    from PIL import Image

    vertices = avatar.vertices - np.array([0, avatar.ground, 0], np.float32)
    part = find_parts(avatar.faces, avatar.skin_index, avatar.skin_weight, avatar.joint_names)
    flat = unwrap(vertices, avatar.faces, part, SIZE)
    near, colours = vertex_colours(vertices, means, avatar.gaussians.rgb, avatar.gaussians.opacity)
    screen = Camera((SIZE, SIZE), (0.0, 0.0), SIZE, SIZE)
    face, bary, _ = rasterise(np.column_stack([flat.uv, np.ones(len(flat.uv))]), flat.faces, screen)
    _reach_small_faces(face, bary, flat.uv[flat.faces].mean(1))
    turn = Rotation.from_quat(to_xyzw(quats)).as_matrix()
    corners, places = flat.uv[flat.faces] * SIZE, vertices[avatar.faces].astype(np.float64)
    normal = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    picture = _draw(
        face, bary, np.stack([corners.min(1), corners.max(1)], axis=1).astype(np.int64), vertices.astype(np.float64),
        avatar.faces.astype(np.int64), normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20), colours,
        near.astype(np.int64), avatar.gaussians.face.astype(np.int64), means.astype(np.float64),
        (turn * scales[:, None] ** 2) @ turn.transpose(0, 2, 1), np.clip(avatar.gaussians.rgb, 0, 1).astype(np.float32),
        avatar.gaussians.opacity.astype(np.float64))
    pixels = fill_gaps(picture, face >= 0)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=QUALITY, subsampling=0)
    normals = vertex_normals(vertices, avatar.faces).astype(np.float32)
    return Surface(flat.vertex, flat.faces, flat.uv, vertices[flat.vertex], normals[flat.vertex], file.getvalue())


def vertex_colours(vertices: np.ndarray, means: np.ndarray, rgb: np.ndarray,
                   opacity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """vertices: (V, 3) m; means: (N, 3) m in the same pose; rgb: (N, 3) sRGB; opacity: (N,).

    Returns the nearest gaussians (V, K) of each vertex, and (V, 3) float32 sRGB: their mean, weighted by opacity and nearness. The
    binding does not serve: training moves gaussians away from the face that carries them.
    """
    distance, near = KDTree(means).query(vertices, k=min(NEAREST, len(means)))
    distance, near = distance.reshape(len(vertices), -1), near.reshape(len(vertices), -1)
    weight = (opacity[near] + 1e-6) / (distance ** 2 + BLUR_M ** 2)
    return near, np.einsum("vk,vkc->vc", weight / weight.sum(1, keepdims=True), np.clip(rgb, 0, 1)[near]).astype(np.float32)


def _reach_small_faces(face: np.ndarray, bary: np.ndarray, middle: np.ndarray) -> None:
    """Gives each face that covers no texel's centre the texel under its own, if that is free.

    face: (S, S) and bary: (S, S, 3) of the texels, changed in place; middle: (F, 2) in 0..1.
    """
    missed = np.flatnonzero(np.bincount(face[face >= 0], minlength=len(middle)) == 0)
    column, row = (middle[missed] * len(face)).astype(int).T
    free = face[row, column] < 0
    face[row[free], column[free]], bary[row[free], column[free]] = missed[free], 1 / 3


def fill_gaps(picture: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Gives each texel between charts a mean of those around, so that small copies of the picture show no seams (push and pull).

    The nearest get the colour of their own chart. picture: (S, S, 3) float32 in 0..1, 0 where nothing is known, used
    up; S: a power of two; known: (S, S) bool. Returns (S, S, 3) uint8.
    """
    levels = [(picture, _grow(picture, known, GUTTER))]
    while len(levels[-1][1]) > 1 and not levels[-1][1].all():
        levels.append(_halve(*levels[-1]))
    coarse = levels[-1][0]
    for fine, there in levels[-2::-1]:
        _take_over(fine, there, coarse)
        coarse = fine
    coarse *= 255
    coarse += 0.5
    return coarse.astype(np.uint8)


@own_kernel(nogil=True)
def _grow(picture, known, deep):  # noqa: ANN001, ANN202
    """Gives texels beside known ones, so many deep, their neighbours' mean, in place. Returns what is known then."""
    S = len(known)
    ring = known.astype(np.uint8)
    for depth in range(2, 2 + deep):
        for row in range(S):
            for column in range(S):
                if ring[row, column]:
                    continue
                count = 0
                for y, x in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
                    if 0 <= y < S and 0 <= x < S and 0 < ring[y, x] < depth:
                        count += 1
                        for c in range(3):
                            picture[row, column, c] += picture[y, x, c]
                if count:
                    ring[row, column] = depth
                    for c in range(3):
                        picture[row, column, c] /= count
    return ring > 0


@own_kernel(nogil=True)
def _halve(picture, known):  # noqa: ANN001, ANN202
    """(S / 2, S / 2, 3) means of the known texels of each four, and whether there is one."""
    half = np.zeros((len(known) // 2, len(known) // 2, 3), np.float32)
    there = np.zeros(half.shape[:2], np.bool_)
    for row in range(len(half)):
        for column in range(len(half)):
            count = 0
            for y in range(2 * row, 2 * row + 2):
                for x in range(2 * column, 2 * column + 2):
                    if known[y, x]:
                        count += 1
                        for c in range(3):
                            half[row, column, c] += picture[y, x, c]
            there[row, column] = count > 0
            for c in range(3):
                half[row, column, c] /= max(count, 1)
    return half, there


@own_kernel(nogil=True)
def _take_over(fine, known, coarse):  # noqa: ANN001, ANN202
    """Copies the coarse texel to those of fine that are not known."""
    for row in range(len(fine)):
        for column in range(len(fine)):
            if not known[row, column]:
                for c in range(3):
                    fine[row, column, c] = coarse[row // 2, column // 2, c]


@own_kernel(nogil=True)
def _draw(face, bary, boxes, vertices, faces, normal, colours, near, bound_to, means, covariance, rgb,  # noqa: ANN001, ANN202
          opacity):
    """Draws the gaussians over the mesh's own colours, each face flat. Returns (S, S, 3) float32, 0 where no face.

    face: (S, S), bary: (S, S, 3) of the texels; boxes: (F, 2, 2) first and last texel of each face; vertices: (V, 3);
    faces: (F, 3); normal: (F, 3) unit; colours: (V, 3); near: (V, K) gaussians to look at; bound_to: (N,) face of each;
    means: (N, 3); covariance: (N, 3, 3); rgb: (N, 3); opacity: (N,).
    """
    F, K = len(faces), 3 * near.shape[1]
    which, conic, flat, depth = np.empty(K, np.int64), np.empty((K, 5)), np.empty((3, 2)), np.empty(K)
    out = np.zeros((len(face), len(face), 3), np.float32)
    for f in range(F):
        count = -1
        for row in range(boxes[f, 0, 1], boxes[f, 1, 1] + 1):
            for column in range(boxes[f, 0, 0], boxes[f, 1, 0] + 1):
                if face[row, column] != f:
                    continue
                if count < 0:
                    count = _look_at(f, vertices, faces, near, normal, bound_to, means, covariance, which, conic, flat, depth)
                x = y = 0.0
                left, red, green, blue = 1.0, 0.0, 0.0, 0.0
                for c in range(3):
                    x += bary[row, column, c] * flat[c, 0]
                    y += bary[row, column, c] * flat[c, 1]
                for m in range(count):
                    dx, dy = x - conic[m, 3], y - conic[m, 4]
                    far = conic[m, 0] * dx * dx + 2 * conic[m, 1] * dx * dy + conic[m, 2] * dy * dy
                    if far > SPREAD:
                        continue
                    g = which[m]
                    alpha = min(opacity[g] * np.exp(-0.5 * far), MOST_ALPHA)
                    red += left * alpha * rgb[g, 0]
                    green += left * alpha * rgb[g, 1]
                    blue += left * alpha * rgb[g, 2]
                    left *= 1 - alpha
                    if left < LEFT:
                        break
                for c in range(3):
                    weight, corner = left * bary[row, column, c], faces[f, c]
                    red += weight * colours[corner, 0]
                    green += weight * colours[corner, 1]
                    blue += weight * colours[corner, 2]
                out[row, column, 0], out[row, column, 1], out[row, column, 2] = red, green, blue
    return out


@own_kernel(nogil=True)
def _look_at(f, vertices, faces, near, normal, bound_to, means, covariance, which, conic, flat, depth):  # noqa: ANN001, ANN202
    """Fills in the gaussians before one face, the outermost first, and their shapes in its plane. Returns their number."""
    n, kept = (normal[f, 0], normal[f, 1], normal[f, 2]), 0
    s = 1.0 if n[2] >= 0 else -1.0  # a basis of the face's plane without a branch (Duff et al. 2017)
    p = -1.0 / (s + n[2])
    q = n[0] * n[1] * p
    u = (1.0 + s * n[0] * n[0] * p, s * q, -s * n[0])
    v = (q, s + n[1] * n[1] * p, -n[1])
    for corner in range(3):
        at = faces[f, corner]
        flat[corner, 0] = vertices[at, 0] * u[0] + vertices[at, 1] * u[1] + vertices[at, 2] * u[2]
        flat[corner, 1] = vertices[at, 0] * v[0] + vertices[at, 1] * v[1] + vertices[at, 2] * v[2]
        for k in range(near.shape[1]):
            g = near[at, k]
            b, known = bound_to[g], False
            for m in range(kept):
                known = known or which[m] == g
            if known or normal[b, 0] * n[0] + normal[b, 1] * n[1] + normal[b, 2] * n[2] <= 0:
                continue  # or of the next finger, or of the other side
            away = means[g, 0] * n[0] + means[g, 1] * n[1] + means[g, 2] * n[2]
            place = kept
            while place > 0 and depth[place - 1] < away:
                depth[place], which[place] = depth[place - 1], which[place - 1]
                place -= 1
            depth[place], which[place] = away, g
            kept += 1
    x0, y0 = flat[:, 0].mean(), flat[:, 1].mean()
    reach = np.sqrt(((flat[:, 0] - x0) ** 2 + (flat[:, 1] - y0) ** 2).max())
    used = 0
    for m in range(kept):
        g = which[m]
        uu = vv = LOW_PASS_M ** 2
        uv = x = y = 0.0
        for a in range(3):
            x += means[g, a] * u[a]
            y += means[g, a] * v[a]
            across = covariance[g, a, 0] * u[0] + covariance[g, a, 1] * u[1] + covariance[g, a, 2] * u[2]
            along = covariance[g, a, 0] * v[0] + covariance[g, a, 1] * v[1] + covariance[g, a, 2] * v[2]
            uu += u[a] * across
            uv += v[a] * across
            vv += v[a] * along
        area = uu * vv - uv * uv
        a, b, c, dx, dy = vv / area, -uv / area, uu / area, x0 - x, y0 - y
        # How far from the gaussian the face's middle is, less how far its corners can be nearer.
        if np.sqrt(a * dx * dx + 2 * b * dx * dy + c * dy * dy) - reach * np.sqrt(a + c) > np.sqrt(SPREAD):
            continue
        which[used] = g
        conic[used, 0], conic[used, 1], conic[used, 2], conic[used, 3], conic[used, 4] = a, b, c, x, y
        used += 1
    return used
