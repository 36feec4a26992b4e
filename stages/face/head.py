"""The person's head at rest as a mesh: the open body's head, or one that the user brings (`flame.py`).

The network's points have no scale, so the shape is fitted up to a similarity; the scale stays that of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar import joints
from gsac.avatar.body import Body
from gsac.stages.face.actions import Actions

POINT_NOISE = 0.002
"""Standard deviation of a resting point, m."""
AXES = np.array([1.0, 1.0, 0.3])
"""Weights of the network's x, y and z."""
ROUNDS = 10
"""Alternations between shape and similarity."""


@dataclass
class HeadModel:
    """A head mesh of N vertices with S directions in which people's heads differ from it, and L of the network's points on it."""

    template: np.ndarray  # (N, 3) m, y up, z out of the face
    faces: np.ndarray  # (F, 3)
    shapedirs: np.ndarray  # (N, 3, S) m at one standard deviation
    eyes: np.ndarray  # (2, 3) m of the template, left and right
    index: np.ndarray  # (L,) the network's points that lie on it
    corners: np.ndarray  # (L, 3) the vertices of the face on which each lies
    share: np.ndarray  # (L, 3) its barycentric coordinates there
    neutral: np.ndarray | None = None  # (468, 3) m, where the network puts them on the template; None: on the mesh

    @classmethod
    def of_open_body(cls, actions: Actions) -> HeadModel:
        """The open body's head, with the shape directions of the figure, without those of the clothes."""
        body = Body.load()
        on = body.weights[:, [joints.HEAD, joints.JAW, *joints.EYES]].sum(1) > 0.5
        on[np.unique(actions.corner)] = True
        place = np.cumsum(on) - 1
        faces = body.faces[on[body.faces].all(1)]
        return cls(body.v_template[on], place[faces], body.shapedirs[on][:, :, : body.num_figure],
                   body.J_regressor[joints.EYES] @ body.v_template, np.arange(len(actions.corner)), place[actions.corner],
                   actions.share, actions.neutral)

    def at_points(self, values: np.ndarray) -> np.ndarray:
        """values: (N, ...) of the vertices. Returns them interpolated at the points (L, ...)."""
        return np.einsum("lk,lk...->l...", self.share, values[self.corners])

    def fit_shape(self, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """rest: (468, 3) m, y up, z out of the face, the person's points. Returns the likeliest shape (S,), and the turn (3, 3) and
        size that bring the head's points onto these."""
        target = rest[self.index]
        mean, directions = self.at_points(self.template).astype(float), self.at_points(self.shapedirs).astype(float)
        if self.neutral is not None:  # the network's points differ from the skin by the same in all people
            turn, size, shift = fit_similarity(mean, self.neutral[self.index])
            target = target - self.neutral[self.index] + size * mean @ turn.T + shift
        shape = np.zeros(directions.shape[2])
        for _ in range(ROUNDS):
            turn, size, shift = fit_similarity(mean + directions @ shape, target)
            columns = (size * np.einsum("ab,lbs->las", turn, directions) * AXES[:, None]).reshape(-1, len(shape))
            missing = ((target - shift - size * mean @ turn.T) * AXES).ravel()
            shape = np.linalg.solve(columns.T @ columns + POINT_NOISE**2 * np.eye(len(shape)), columns.T @ missing)
        return shape, turn, size

    def arrays(self, shape: np.ndarray) -> dict[str, np.ndarray]:
        """shape: (S,). Returns the arrays of face.npz that `HEAD_SHAPES` names."""
        return {"head_template": self.template.astype(np.float32), "head_faces": self.faces.astype(np.int32),
                "head_vertices": (self.template + self.shapedirs @ shape).astype(np.float32),
                "head_eyes": self.eyes.astype(np.float32)}


def fit_similarity(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """source, target: (n, 3). Returns the turn (3, 3), size and shift (3,) that bring source nearest to target (Umeyama)."""
    a, b = source - source.mean(0), target - target.mean(0)
    u, spread, vt = np.linalg.svd(b.T @ a)
    signs = np.array([1, 1, np.sign(np.linalg.det(u @ vt))])
    turn = (u * signs) @ vt
    size = float((spread * signs).sum() / max((a**2).sum(), 1e-12))
    return turn, size, target.mean(0) - size * turn @ source.mean(0)
