"""Fixed lists by which the kernels gather instead of scatter: sums then have one order, whatever the threads do."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from gsac.avatar.mesh import distinct_pairs


def joint_levels(parents: np.ndarray) -> np.ndarray:
    """(J,) distance of each joint from its root; parents (-1: root) come before children."""
    level = np.zeros(len(parents), np.int32)
    for j, p in enumerate(parents):
        level[j] = 0 if p < 0 else level[p] + 1
    return level


def children(parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """start (J + 1,) and the joints' children, child[start[j]:start[j + 1]]."""
    parents = np.asarray(parents, np.int64)
    child = np.argsort(parents, kind="stable")[(parents < 0).sum():]
    return _starts(parents[child], len(parents)), child


def joints_of(skin_index: np.ndarray, skin_weight: np.ndarray, joints: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """start (J + 1,), vertex and weight: the vertices that each joint carries."""
    joint, weight = np.asarray(skin_index).reshape(-1), np.asarray(skin_weight).reshape(-1)
    carried = np.flatnonzero(weight != 0)
    carried = carried[np.argsort(joint[carried], kind="stable")]
    return _starts(joint[carried], joints), carried // skin_index.shape[1], weight[carried]


def vertices_of(faces: np.ndarray, face: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """start (V + 1,) and item: 3 gaussian + corner, for the corners of gaussians' faces that are the vertex."""
    corner = np.asarray(faces)[face].reshape(-1)
    item = np.argsort(corner, kind="stable")
    return _starts(corner[item], vertices), item


def neighbours(faces: np.ndarray, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """start (V + 1,) and the vertices that share an edge with each vertex."""
    return _neighbours(np.ascontiguousarray(faces, np.int64).tobytes(), vertices)


@lru_cache(maxsize=2)  # a fit asks for those of its body time and again
def _neighbours(faces: bytes, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    faces = np.frombuffer(faces, np.int64).reshape(-1, 3)
    i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    owner, near = distinct_pairs(np.r_[i, j], np.r_[j, i], vertices)
    start = _starts(owner, vertices)
    start.flags.writeable = near.flags.writeable = False
    return start, near


def _starts(owner: np.ndarray, count: int) -> np.ndarray:
    return np.searchsorted(owner, np.arange(count + 1)).astype(np.int32)
