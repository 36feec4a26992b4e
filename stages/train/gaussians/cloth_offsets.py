"""Clothes and hair: a smooth displacement of the rest vertices, learned first, then folded into the gaussians.

The body is thinner than the clothed person. Gaussians that leave it one by one make a furry surface; moved together they stay a
skin. Steps are smoothed by (1 + lambda L)^-1, L the mesh's uniform Laplacian, with one Adam scale for all vertices (Nicolet et al.
2021, Large Steps in Inverse Rendering).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix, diags, identity
from scipy.sparse.linalg import splu

from gsac.avatar.binding import bind, face_frames, unbind
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import FINGERS
from gsac.stages.train.checkpoint import State

SMOOTHNESS = 30.0
"""lambda: a step spreads over about its square root of edges. Fingers are not displaced; they are thin, and their error is pose."""
EVERY = 4
"""Steps whose gradients are gathered for one step of the offsets."""
KEPT = ("offset", "first", "second", "gathered", "seen", "count")
"""Attributes of Offsets that training changes."""


class Offsets:
    """offset: (V, 3) float32 m, added to the body's vertices at rest, with Adam's state."""

    def __init__(self, body: Body):
        faces, vertices = np.asarray(body.faces, np.int64), len(body.v_template)
        i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
        edges = coo_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), (vertices, vertices)).tocsr()
        edges.data[:] = 1
        laplacian = diags(np.asarray(edges.sum(1)).ravel()) - edges
        self.solve = splu((identity(vertices) + SMOOTHNESS * laplacian).tocsc(), permc_spec="MMD_AT_PLUS_A",
                          options={"SymmetricMode": True}).solve
        self.share = 1 - np.where(body.skin_index >= FINGERS.start, body.skin_weight, 0).sum(1, keepdims=True)
        self.offset = np.zeros((vertices, 3), np.float32)
        self.first, self.second = np.zeros((vertices, 3)), 0.0
        self.gathered, self.seen, self.count = np.zeros((vertices, 3)), 0, 0

    def state(self) -> State:
        """For a checkpoint."""
        return {name: getattr(self, name) for name in KEPT}

    def restore(self, state: State) -> None:
        """Takes the place of the Offsets that `state` was called on."""
        for name in KEPT:
            setattr(self, name, state[name])

    def gather(self, grad: np.ndarray, rate: float) -> None:
        """Adds a gradient of the rest vertices, grad (V, 3); each EVERY-th call takes a step of the offsets. rate: m."""
        self.gathered += grad
        self.seen += 1
        if self.seen < EVERY:
            return
        smooth = self.solve(self.gathered * self.share / EVERY)
        self.gathered[:], self.seen = 0, 0
        self.count += 1
        self.first += 0.1 * (smooth - self.first)
        self.second += 0.01 * (np.max(smooth**2) - self.second)
        first, second = self.first / (1 - 0.9**self.count), self.second / (1 - 0.99**self.count)
        self.offset -= (rate * self.solve(first / (np.sqrt(second) + 1e-20))).astype(np.float32)


def fold(gaussians: Gaussians, rest: np.ndarray, offset: np.ndarray, faces: np.ndarray) -> Gaussians:
    """Binds gaussians of the displaced body to the plain one; at rest they stay where they are.

    rest, offset: (V, 3) m; faces: (F, 3).
    """
    g = gaussians
    displaced = bind(face_frames(rest + offset, faces), g.face, g.mu, g.quat, g.log_scale)
    mu, quat, log_scale = unbind(face_frames(rest, faces), g.face, displaced)
    return replace(g, mu=mu, quat=quat, log_scale=log_scale)
