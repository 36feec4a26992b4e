"""Adjacency of joints, vertices and faces as lists, so that kernels gather instead of scatter: sums then have a fixed order.

The list of item i is `items[start[i]:start[i + 1]]`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from gsac.avatar.mesh import distinct_pairs


def joint_levels(parents: np.ndarray) -> np.ndarray:
    """(J,) distance of each joint from its root. parents: (J,), -1 for a root; parents come before children."""
    level = np.zeros(len(parents), np.int32)
    for j, p in enumerate(parents):
        level[j] = 0 if p < 0 else level[p] + 1
    return level


def joint_children(parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """start (J + 1,) and child (C,): the children of each joint. parents: (J,), -1 for a root."""
    parents = np.asarray(parents, np.int64)
    child = np.argsort(parents, kind="stable")[(parents < 0).sum():]
    return _starts(parents[child], len(parents)), child


def joint_vertices(skin_index: np.ndarray, skin_weight: np.ndarray, joints: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """start (J + 1,), vertex (C,) and weight (C,): the vertices that each joint carries. skin_index, skin_weight: (V, 4)."""
    joint, weight = np.asarray(skin_index).reshape(-1), np.asarray(skin_weight).reshape(-1)
    carried = np.flatnonzero(weight != 0)
    carried = carried[np.argsort(joint[carried], kind="stable")]
    return _starts(joint[carried], joints), carried // skin_index.shape[1], weight[carried]


def face_corners(faces: np.ndarray, face: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """start (V + 1,) and item (3 N,): 3 gaussian + corner, the corners of gaussians' faces that each vertex is.

    faces: (F, 3); face: (N,) of the gaussians.
    """
    corner = np.asarray(faces)[face].reshape(-1)
    item = np.argsort(corner, kind="stable")
    return _starts(corner[item], vertices), item


def vertex_neighbours(faces: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """start (V + 1,) and near (2 E,): the vertices that share an edge with each vertex. faces: (F, 3)."""
    return _vertex_neighbours(np.ascontiguousarray(faces, np.int64).tobytes(), vertices)


@lru_cache(maxsize=2)  # a fit asks for those of its body time and again
def _vertex_neighbours(faces: bytes, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    corners = np.frombuffer(faces, np.int64).reshape(-1, 3)
    i, j = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).T
    owner, near = distinct_pairs(np.r_[i, j], np.r_[j, i], vertices)
    start = _starts(owner, vertices)
    start.flags.writeable = near.flags.writeable = False
    return start, near


def _starts(owner: np.ndarray, count: int) -> np.ndarray:
    return np.searchsorted(owner, np.arange(count + 1)).astype(np.int32)
