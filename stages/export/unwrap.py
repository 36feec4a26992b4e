"""Texture coordinates of the mesh: charts of connected faces that look along one axis, flattened along it, packed into a square.

They come from mesh and skin alone, so every avatar has them, whatever body it was made with. Head and hands get more texels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from gsac.avatar.artifacts import ArtifactError

AXES = np.array([(1.0, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
FLAT = np.array([(2, 1), (2, 1), (0, 2), (0, 2), (0, 1), (0, 1)])
"""The coordinates that remain when a chart is flattened along each of `AXES`."""
ROUNDS, COMPANY = 3, 0.3
"""How often a face looks at its neighbours' axes, and how much each counts beside its own normal's cosine."""
HALVINGS = 11
"""Of the interval in which the texels a metre lie."""
GUTTER = 2
"""Texels that are free around each chart."""
ALIKE = 6
"""Heights of charts are alike within a factor of e to the inverse."""
FACING = 0.2
"""Least cosine between a face and the axis that it is flattened along, where its neighbours ask for another than its own."""
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
PARTS = (
    (2.5, ("head", "jaw", "left_eye_smplhf", "right_eye_smplhf")),
    (1.5, ("neck",)),
    *((finer, tuple(f"{side}_{name}" for name in names)) for side in ("left", "right") for finer, names in (
        (1.5, ("wrist", *(f"{finger}{k}" for finger in FINGERS for k in (1, 2, 3)))),
        (1.0, ("shoulder", "elbow")), (1.0, ("hip", "knee")), (1.0, ("ankle", "foot")))),
)
"""(times as many texels a metre, joints) of the parts that are flattened apart from the trunk."""


@dataclass(frozen=True)
class Unwrapped:
    """A mesh whose vertices are doubled where charts meet: W vertices of V."""

    vertex: np.ndarray
    """(W,) int32: the vertex of the mesh that each is."""
    faces: np.ndarray
    """(F, 3) int32, into the W."""
    uv: np.ndarray
    """(W, 2) float32 in 0..1, from the picture's upper left corner."""


def unwrap(vertices: np.ndarray, faces: np.ndarray, part: np.ndarray, size: int) -> Unwrapped:
    """vertices: (V, 3) m at rest; faces: (F, 3); part: (F,) index into `PARTS`, -1 elsewhere; size: px of the square texture."""
    pairs = _neighbours(faces, len(vertices))
    axis = _choose_axes(vertices, faces, pairs)
    same = (axis[pairs[0]] == axis[pairs[1]]) & (part[pairs[0]] == part[pairs[1]])
    links = coo_matrix((np.ones(same.sum(), bool), (pairs[0][same], pairs[1][same])), shape=(len(faces),) * 2)
    charts, chart = connected_components(links, directed=False)
    flat = np.take_along_axis(vertices[faces].astype(np.float64), FLAT[axis][:, None, :], axis=2)
    flat *= np.array([*(finer for finer, _ in PARTS), 1.0])[part, None, None]
    low, high = np.full((charts, 2), np.inf), np.full((charts, 2), -np.inf)
    np.minimum.at(low, chart, flat.min(1))
    np.maximum.at(high, chart, flat.max(1))
    owner = np.empty(charts, int)
    owner[chart] = part
    scale, corner = _pack(high - low, owner, size)
    px = (flat - low[chart][:, None]) * scale + corner[chart][:, None] + GUTTER
    ends = chart.astype(np.int64)[:, None] * len(vertices) + faces
    ends, first, split = np.unique(ends.ravel(), return_index=True, return_inverse=True)
    uv = (px.reshape(-1, 2)[first] / size).astype(np.float32)
    return Unwrapped((ends % len(vertices)).astype(np.int32), split.reshape(faces.shape).astype(np.int32),
                     np.column_stack([uv[:, 0], 1 - uv[:, 1]]))


def find_parts(faces: np.ndarray, skin_index: np.ndarray, skin_weight: np.ndarray, joint_names: list[str]) -> np.ndarray:
    """(F,) index into `PARTS` of the joint that carries each face's first vertex most, -1 on the trunk.

    faces: (F, 3); skin_index, skin_weight: (V, 4).
    """
    of_name = {name: n for n, (_, names) in enumerate(PARTS) for name in names}
    of_joint = np.array([of_name.get(name, -1) for name in joint_names])
    first = faces[:, 0]
    return of_joint[np.take_along_axis(skin_index[first], skin_weight[first].argmax(1)[:, None], axis=1)[:, 0]]


def _neighbours(faces: np.ndarray, count: int) -> np.ndarray:
    """(2, P) faces that share an edge."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    number = edges[:, 0].astype(np.int64) * count + edges[:, 1]
    order = np.argsort(number, kind="stable")
    meet = number[order][1:] == number[order][:-1]
    return np.stack([order[:-1][meet], order[1:][meet]]) // 3


def _choose_axes(vertices: np.ndarray, faces: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(F,) index into `AXES`: the one nearest to the normal, smoothed over neighbours so that charts are few."""
    corner = vertices[faces].astype(np.float64)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    facing = normal @ AXES.T
    axis = facing.argmax(1)
    open_to = np.where(facing >= np.minimum(FACING, facing.max(1, keepdims=True)), facing, -np.inf)
    a, b = np.concatenate([pairs, pairs[::-1]], axis=1)
    for _ in range(ROUNDS):
        votes = np.bincount(a * len(AXES) + axis[b], minlength=len(faces) * len(AXES)).reshape(-1, len(AXES))
        axis = (open_to + COMPANY * votes).argmax(1)
    return axis


def _pack(spans: np.ndarray, part: np.ndarray, size: int) -> tuple[float, np.ndarray]:
    """Rows of charts, the highest first, and of about equal ones those of a part together, whose colours are alike.

    spans: (C, 2) width and height, m; part: (C,).

    Returns the texels a metre, as many as there is room for, and (C, 2) px of each chart's lower left corner, its gutter included.
    """
    order = np.lexsort((part, -np.rint(ALIKE * np.log(np.maximum(spans[:, 1], 1e-9)))))
    low, high, best = 0.0, float(size) / max(spans.max(), 1e-9), None
    for _ in range(HALVINGS):
        scale = (low + high) / 2
        corner = _rows(np.ceil(spans[order] * scale).astype(int) + 1 + 2 * GUTTER, size)
        if corner is None:
            high = scale
        else:
            low, best = scale, corner
    if best is None:
        raise ArtifactError(f"the mesh falls apart into {len(spans)} pieces, which find no room in {size} x {size} texels")
    out = np.empty_like(spans)
    out[order] = best
    return low, out


def _rows(boxes: np.ndarray, size: int) -> np.ndarray | None:
    """boxes: (C, 2) px, the highest first. Returns (C, 2) px of their corners; None where they find no room."""
    corner = np.empty(boxes.shape)
    x = y = row = 0
    for n, (width, height) in enumerate(boxes.tolist()):
        if x + width > size:
            x, y, row = 0, y + row, 0
        row = max(row, height)
        if width > size or y + height > size:
            return None
        corner[n] = x, y
        x += width
    return corner
