"""Pose correctives as an avatar's file carries them: the pairs of vertex and joint that matter.

V vertices, J joints, C pairs, D = 9 (J - 1) directions of a body's own correctives (correctives.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar import rotation

LEFT_OUT = 5e-5
"""m by which what `thin_out` leaves out can move a vertex at most, whatever the pose."""
FARTHEST = 2 * np.sqrt(2)
"""Largest norm of a rotation less the identity, at half a turn."""


@dataclass
class SparseCorrectives:
    """The correctives of the pairs of vertex and joint that matter: those of vertex v are rows start[v] .. start[v + 1] - 1."""

    start: np.ndarray  # (V + 1,) int32
    joint: np.ndarray  # (C,) int32, never the root
    delta: np.ndarray  # (C, 3, 9) float32 m

    def move_rest(self, pose: np.ndarray) -> np.ndarray:
        """(V, 3) float32 m that a pose, (J, 3) axis-angle, adds to the vertices at rest."""
        turns = (rotation.exp(np.asarray(pose, np.float64)) - np.eye(3)).reshape(-1, 9).astype(np.float32)
        moved = np.einsum("cab,cb->ca", self.delta, turns[self.joint])
        vertex = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        return np.stack([np.bincount(vertex, column, len(self.start) - 1) for column in moved.T], 1).astype(np.float32)


def thin_out(posedirs: np.ndarray) -> SparseCorrectives:
    """The pairs that matter: of each vertex the least ones are left out, up to LEFT_OUT together. posedirs: (V, 3, D) m."""
    pairs = posedirs.reshape(len(posedirs), 3, -1, 9).transpose(0, 2, 1, 3)  # (V, J - 1, 3, 9)
    reach = FARTHEST * np.sqrt(np.einsum("vjab,vjab->vj", pairs, pairs, dtype=np.float64))
    order = np.argsort(reach, 1)
    least = np.cumsum(np.take_along_axis(reach, order, 1), 1) <= LEFT_OUT
    kept = np.ones(reach.shape, bool)
    np.put_along_axis(kept, order, ~least, 1)
    vertex, joint = np.nonzero(kept)
    start = np.searchsorted(vertex, np.arange(len(posedirs) + 1))
    return SparseCorrectives(start.astype(np.int32), (joint + 1).astype(np.int32), pairs[vertex, joint].astype(np.float32))
