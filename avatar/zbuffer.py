"""Z-buffer triangle rasteriser on the CPU (numba): face, barycentric coordinates and depth at each pixel centre.

Watertight: projected corners are snapped to 1/1024 px, so that an edge function is exact in float64 and the two faces
of an edge get opposite signs; a pixel centre on the edge itself belongs to one of them (top-left rule). Both windings
are drawn. A face with a corner at or behind `near`, or not finite, is left out whole (no clipping).
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.camera import Camera
from gsac.avatar.numba_kernel import own_kernel

NEAR = 0.01
"""Metres."""
_SNAP = 1024.0


def rasterise(vertices: np.ndarray, faces: np.ndarray, camera: Camera,
              near: float = NEAR) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draws a mesh. vertices: (V, 3) m, camera frame; faces: (F, 3) int; near: m.

    Returns face_id (H, W) int32, -1 where no face; bary (H, W, 3) float32, perspective-correct weights of the face's
    corners, 0 where none; depth (H, W) float32, z in m, inf where none. At equal depth the face of lower index wins.
    """
    vertices, faces = _check(vertices, faces)
    return _rasterise(_screen(vertices, camera), vertices[:, 2], faces, camera.width, camera.height, near)


def silhouette(vertices: np.ndarray, faces: np.ndarray, camera: Camera, near: float = NEAR) -> np.ndarray:
    """(H, W) bool, exactly `rasterise(...)[0] >= 0`, without depth and barycentrics.

    vertices: (V, 3) m, camera frame; faces: (F, 3) int.
    """
    vertices, faces = _check(vertices, faces)
    return _silhouette(_screen(vertices, camera), vertices[:, 2], faces, camera.width, camera.height, near)


def interpolate(attributes: np.ndarray, faces: np.ndarray, face_id: np.ndarray, bary: np.ndarray) -> np.ndarray:
    """Values of the vertices at each pixel: (H, W, C) float32, 0 where no face.

    attributes: (V, C); faces: (F, 3) int; face_id: (H, W) and bary: (H, W, 3) of `rasterise`.
    """
    attributes = np.ascontiguousarray(attributes, dtype=np.float32)
    return _interpolate(attributes, np.ascontiguousarray(faces, dtype=np.int64), face_id, bary)


def visible_points(points: np.ndarray, depth: np.ndarray, camera: Camera, slack: float = 0.01) -> np.ndarray:
    """(N,) bool: whether a point is inside the image, before the camera and not hidden by a nearer surface.

    points: (N, 3) m, camera frame; depth: (H, W) m of `rasterise`; slack: m that a point may lie behind the surface.
    """
    points = np.asarray(points, dtype=np.float64)
    front = points[:, 2] > NEAR
    xy = camera.project(np.where(front[:, None], points, 1.0))
    inside = front & (xy >= 0).all(1) & (xy[:, 0] < camera.width) & (xy[:, 1] < camera.height)
    column, row = np.where(inside[:, None], xy, 0).astype(np.int64).T
    return inside & (points[:, 2] <= depth[row, column] + slack)


def _check(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both as the kernels take them, float64 and int64; raises `ValueError` for wrong shapes or indices."""
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"expected vertices (V, 3) and faces (F, 3), got {vertices.shape} and {faces.shape}")
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError(f"faces name vertices outside 0..{len(vertices) - 1}")
    return vertices, faces


def _screen(vertices: np.ndarray, camera: Camera) -> np.ndarray:
    """(V, 2) projected px on the snap grid; not finite where the camera cannot see a point."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.round(camera.project(vertices) * _SNAP) / _SNAP


@own_kernel(inline="always")
def _edge(ax, ay, bx, by, px, py):
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@own_kernel(inline="always")
def _owns(ax, ay, bx, by):
    """Whether a face that lies at `_edge > 0` owns the centres on its edge a -> b: a left or a top edge (y down)."""
    return by < ay or (by == ay and bx > ax)


@own_kernel(inline="always")
def _setup(screen, z, faces, f, width, height, near):
    """Corners (b and c swapped so that the area is positive), area, swapped or not, pixel box; area 0 = skip."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay, bx, by, cx, cy = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1], screen[c, 0], screen[c, 1]
    x0, x1, y0, y1 = 0, 0, 0, 0
    area = 0.0
    swapped = False
    if z[a] > near and z[b] > near and z[c] > near:
        area = _edge(ax, ay, bx, by, cx, cy)
        if area < 0:
            bx, by, cx, cy = cx, cy, bx, by
            area = -area
            swapped = True
        if area > 0 and area < np.inf:
            # Centres at +0.5: the first is the lowest integer i with i + 0.5 >= the box's edge.
            x0 = int(np.ceil(min(max(min(ax, bx, cx) - 0.5, 0.0), width)))
            x1 = int(np.floor(max(min(max(ax, bx, cx) - 0.5, width - 1.0), -1.0))) + 1
            y0 = int(np.ceil(min(max(min(ay, by, cy) - 0.5, 0.0), height)))
            y1 = int(np.floor(max(min(max(ay, by, cy) - 0.5, height - 1.0), -1.0))) + 1
        else:
            area = 0.0
    return ax, ay, bx, by, cx, cy, area, swapped, x0, x1, y0, y1


@own_kernel(nogil=True)
def _rasterise(screen, z, faces, width, height, near):
    face_id = np.full((height, width), -1, np.int32)
    bary = np.zeros((height, width, 3), np.float32)
    depth = np.full((height, width), np.inf, np.float32)
    for f in range(len(faces)):
        ax, ay, bx, by, cx, cy, area, swapped, x0, x1, y0, y1 = _setup(screen, z, faces, f, width, height, near)
        if area == 0.0:
            continue
        own_a, own_b, own_c = _owns(bx, by, cx, cy), _owns(cx, cy, ax, ay), _owns(ax, ay, bx, by)
        b, c = faces[f, 1], faces[f, 2]
        if swapped:
            b, c = c, b
        iza, izb, izc = 1.0 / z[faces[f, 0]] / area, 1.0 / z[b] / area, 1.0 / z[c] / area
        for y in range(y0, y1):
            py = y + 0.5
            for x in range(x0, x1):
                px = x + 0.5
                ea = _edge(bx, by, cx, cy, px, py)
                eb = _edge(cx, cy, ax, ay, px, py)
                ec = _edge(ax, ay, bx, by, px, py)
                if ea < 0 or eb < 0 or ec < 0:
                    continue
                if (ea == 0 and not own_a) or (eb == 0 and not own_b) or (ec == 0 and not own_c):
                    continue
                wa, wb, wc = ea * iza, eb * izb, ec * izc
                d = 1.0 / (wa + wb + wc)
                if np.float32(d) < depth[y, x]:
                    depth[y, x] = d
                    face_id[y, x] = f
                    bary[y, x, 0] = wa * d
                    bary[y, x, 1] = (wc if swapped else wb) * d
                    bary[y, x, 2] = (wb if swapped else wc) * d
    return face_id, bary, depth


@own_kernel(nogil=True)
def _silhouette(screen, z, faces, width, height, near):
    mask = np.zeros((height, width), np.bool_)
    for f in range(len(faces)):
        ax, ay, bx, by, cx, cy, area, swapped, x0, x1, y0, y1 = _setup(screen, z, faces, f, width, height, near)
        if area == 0.0:
            continue
        own_a, own_b, own_c = _owns(bx, by, cx, cy), _owns(cx, cy, ax, ay), _owns(ax, ay, bx, by)
        for y in range(y0, y1):
            py = y + 0.5
            for x in range(x0, x1):
                if mask[y, x]:
                    continue
                px = x + 0.5
                ea = _edge(bx, by, cx, cy, px, py)
                eb = _edge(cx, cy, ax, ay, px, py)
                ec = _edge(ax, ay, bx, by, px, py)
                mask[y, x] = (ea > 0 or (ea == 0 and own_a)) and (eb > 0 or (eb == 0 and own_b)) and (
                    ec > 0 or (ec == 0 and own_c))
    return mask


@own_kernel(nogil=True)
def _interpolate(attributes, faces, face_id, bary):
    height, width = face_id.shape
    channels = attributes.shape[1]
    out = np.zeros((height, width, channels), np.float32)
    for y in range(height):
        for x in range(width):
            f = face_id[y, x]
            if f >= 0:
                for k in range(3):
                    v, w = faces[f, k], bary[y, x, k]
                    for c in range(channels):
                        out[y, x, c] += w * attributes[v, c]
    return out
