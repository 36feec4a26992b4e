"""The face terms of the published method: the body's resting head against a head mesh that a face network found.

The network's head (FLAME's, or any other) comes in face.npz: `head_vertices` (N, 3) m at rest, `head_index` (N,) the body's
vertex that each stands for, `head_faces` (F, 3) over the N.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from gsac.avatar.body import Body
from gsac.avatar.wholebody import FACE, INDEX
from gsac.stages.contract import StageError

VERTEX, LAPLACIAN, EDGE = 10.0, 10000.0, 1.0
"""Weights of the paper's L_face."""
VISIBLE = float(np.cos(np.radians(135)))
EYES = [INDEX["left_eye"], INDEX["right_eye"]]
EARS = [INDEX["left_ear"], INDEX["right_ear"]]


@dataclass
class Head:
    """A head at rest, N vertices."""

    vertices: np.ndarray  # (N, 3) m
    index: np.ndarray  # (N,) the body's vertices
    faces: np.ndarray  # (F, 3)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray], body: Body) -> Head | None:
        """The head of face.npz's arrays; None where the face method gives none. Raises StageError."""
        if "head_vertices" not in arrays:
            return None
        for name in ("head_index", "head_faces"):
            if name not in arrays:
                raise StageError(f"face.npz has head_vertices but no {name}")
        head = cls(arrays["head_vertices"], arrays["head_index"].astype(int), arrays["head_faces"].astype(int))
        n = len(head.vertices)
        if head.index.shape != (n,) or head.index.max(initial=0) >= len(body.v_template):
            raise StageError(f"face.npz: head_index must name one of the body's {len(body.v_template)} vertices for each of {n}")
        if head.faces.ndim != 2 or head.faces.shape[1] != 3 or head.faces.max(initial=0) >= n:
            raise StageError(f"face.npz: head_faces must be (F, 3) over the {n} head vertices")
        return head


class HeadTerms:
    """L_face as a function of the betas."""

    def __init__(self, body: Body, head: Head):
        self.rest = torch.tensor(body.v_template[head.index])
        self.dirs = torch.tensor(body.shapedirs[head.index])
        target = torch.tensor(np.asarray(head.vertices, np.float32))
        self.target = target - target.mean(0)
        pairs = np.unique(np.sort(np.concatenate([head.faces[:, [0, 1]], head.faces[:, [1, 2]], head.faces[:, [2, 0]]]), 1), axis=0)
        self.pairs = torch.tensor(pairs)
        both = np.concatenate([pairs, pairs[:, ::-1]])
        degree = np.bincount(both[:, 0], minlength=len(head.vertices))
        self.from_, self.to = torch.tensor(both[:, 0].copy()), torch.tensor(both[:, 1].copy())
        self.share = torch.tensor(1 / np.maximum(degree, 1), dtype=torch.float32)[:, None]

    def loss(self, betas: torch.Tensor) -> torch.Tensor:
        """Weighted sum of vertex L1, Laplacian L2 and edge length L1, each a mean; places are compared with their means removed."""
        x = self.rest + self.dirs @ betas
        x = x - x.mean(0)
        vertex = (x - self.target).abs().mean()
        laplacian = ((self._laplacian(x) - self._laplacian(self.target)) ** 2).mean()
        edge = (self._lengths(x) - self._lengths(self.target)).abs().mean()
        return VERTEX * vertex + LAPLACIAN * laplacian + EDGE * edge

    def _laplacian(self, x: torch.Tensor) -> torch.Tensor:
        around = torch.zeros_like(x).index_add(0, self.from_, x[self.to])
        return x - around * self.share

    def _lengths(self, x: torch.Tensor) -> torch.Tensor:
        return (x[self.pairs[:, 0]] - x[self.pairs[:, 1]]).norm(dim=1)


def visible(points: np.ndarray) -> np.ndarray:
    """points: (T, 133, 3) m, camera frame, NaN where the body carries no such point. (T,) bool: the face looks towards the camera.

    In the camera's xz plane the way from the face's centre to the eyes must lie against the line of sight by more than 135 degrees.
    """
    face = points[:, FACE]
    carried = np.isfinite(face).all((0, 2))
    centre = face[:, carried].mean(1) if carried.any() else points[:, EARS].mean(1)
    look = points[:, EYES].mean(1) - centre
    look, sight = look[:, [0, 2]], centre[:, [0, 2]]
    cos = (look * sight).sum(1) / np.maximum(np.linalg.norm(look, axis=1) * np.linalg.norm(sight, axis=1), 1e-9)
    return cos < VISIBLE
