"""The face terms of the published method: the body's resting head against the head mesh that `face` found.

face.npz holds that head (the open body's own, or FLAME's) as a mesh of its own, N vertices, at rest, m, y up, z out of the face:
`head_template` (N, 3) of the mean person, `head_vertices` (N, 3) of this person, `head_faces` (F, 3), and `head_eyes` (2, 3) of the
template, left and right. The template is aligned with the body's head by the eyes, then by ICP; so each head vertex of any body
has its place on the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import cKDTree

from gsac.avatar import joints, rotation
from gsac.avatar.body import Body
from gsac.avatar.wholebody import INDEX
from gsac.stages.contract import StageError

VERTEX, LAPLACIAN, EDGE = 10.0, 10000.0, 1.0
"""Weights of the paper's L_face."""
VISIBLE = float(np.cos(np.radians(135)))
EYES = [INDEX["left_eye"], INDEX["right_eye"]]
MIRROR = np.array([-1.0, 1, 1])
"""Left to right in the body's axes."""
ICP_STEPS = 24
"""Rounds of iterative closest points."""
NEAR, LEAST_SHARE = 0.015, 0.3
"""Distance, m, within which a vertex lies on the head mesh, and the share of the head's vertices that must."""


@dataclass
class Head:
    """A person's head at rest, over N vertices of the body."""

    vertices: np.ndarray  # (N, 3) m, at any place
    index: np.ndarray  # (N,) indices of the body's vertices
    faces: np.ndarray  # (F, 3)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray], body: Body) -> Head | None:
        """The head of face.npz's arrays, `head_template` (N, 3), ... as above; None where no face was seen. Raises StageError."""
        if "head_vertices" not in arrays:
            return None
        for name in ("head_template", "head_faces", "head_eyes"):
            if name not in arrays:
                raise StageError(f"face.npz has head_vertices but no {name}")
        template, own, eyes = (arrays[name].astype(float) for name in ("head_template", "head_vertices", "head_eyes"))
        faces = arrays["head_faces"].astype(int)
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.max(initial=0) >= len(own) or template.shape != own.shape:
            raise StageError(f"face.npz: head_faces must be (F, 3) over the {len(own)} head vertices, and head_template like them")
        index, corners, share, turn = lay_on_body(template, faces, eyes, body)
        if len(index) < LEAST_SHARE * select_head(body).sum():
            raise StageError(f"face.npz: only {len(index)} of the body's {select_head(body).sum()} head vertices lie on its head "
                             "mesh; expected a head in metres, y up, z out of the face, with head_eyes its left and right eye")
        places = np.einsum("nk,nkc->nc", share, own[corners]) @ turn.T
        place = np.full(len(body.v_template), -1)
        place[index] = np.arange(len(index))
        kept = place[body.faces]
        return cls(places, index, kept[(kept >= 0).all(1)])


def select_head(body: Body) -> np.ndarray:
    """Vertices (V,) bool that head and jaw carry; the eyes are left out."""
    return body.weights[:, [joints.HEAD, joints.JAW]].sum(1) > 0.5


def lay_on_body(vertices: np.ndarray, faces: np.ndarray, eyes: np.ndarray, body: Body) -> tuple[np.ndarray, ...]:
    """Aligns a head mesh with the body's head by a similarity.

    vertices: (N, 3) m; faces: (F, 3); eyes: (2, 3) m. Returns the index (n,) of the body's vertices that lie on the mesh, corners
    (n, 3) of the face below each and their shares (n, 3), and the rotation (3, 3) from the mesh to the body.
    """
    index = np.flatnonzero(select_head(body))
    skin, around = body.v_template[index].astype(float), find_incident_faces(faces, len(vertices))
    own = (body.J_regressor[joints.EYES] @ body.v_template).astype(float)
    size = np.linalg.norm(own[0] - own[1]) / max(np.linalg.norm(eyes[0] - eyes[1]), 1e-6)
    turn, shift = np.eye(3), own.mean(0) - size * eyes.mean(0)
    for _ in range(ICP_STEPS):
        found, corners, share = find_closest(skin, size * vertices @ turn.T + shift, faces, around)
        far = np.linalg.norm(found - skin, axis=1)
        near = far < max(NEAR, np.median(far))
        source = np.einsum("nk,nkc->nc", share, vertices[corners])[near]
        a, b = source - source.mean(0), skin[near] - skin[near].mean(0)
        turn = rotation.align(a, b)
        size = float((a @ turn.T * b).sum() / max((a**2).sum(), 1e-12))
        shift = skin[near].mean(0) - size * turn @ source.mean(0)
    near = far < NEAR
    return index[near], corners[near], share[near], turn


def find_incident_faces(faces: np.ndarray, count: int) -> np.ndarray:
    """Indices (count, K) of the faces (F, 3) about each vertex, padded with repeats."""
    vertex, face = faces.T.ravel(), np.tile(np.arange(len(faces)), 3)
    order = np.argsort(vertex, kind="stable")
    vertex, face = vertex[order], face[order]
    first = np.searchsorted(vertex, np.arange(count))
    number = np.bincount(vertex, minlength=count)
    at = first[:, None] + np.minimum(np.arange(max(number.max(), 1)), np.maximum(number - 1, 0)[:, None])
    return face[np.minimum(at, len(face) - 1)]


def find_closest(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, ...]:
    """Nearest places (n, 3) on the faces about the nearest vertex, corners (n, 3) of the face and their shares (n, 3).

    points: (n, 3); vertices: (N, 3); faces: (F, 3); around: (N, K) as by `find_incident_faces`.
    """
    tried = faces[around[cKDTree(vertices).query(points)[1]]]  # (n, K, 3)
    a, b, c = (vertices[tried[..., k]] for k in range(3))
    ab, ac, ap = b - a, c - a, points[:, None] - a
    d00, d01, d11 = ((u * v).sum(-1) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    d20, d21 = (ap * ab).sum(-1), (ap * ac).sum(-1)
    area = np.maximum(d00 * d11 - d01**2, 1e-18)
    v, w = (d11 * d20 - d01 * d21) / area, (d00 * d21 - d01 * d20) / area
    share = np.clip(np.stack([1 - v - w, v, w], -1), 0, None)
    share /= share.sum(-1, keepdims=True)
    place = np.einsum("nfk,nfkc->nfc", share, vertices[tried])
    best = np.linalg.norm(place - points[:, None], axis=-1).argmin(1)
    row = np.arange(len(points))
    return place[row, best], tried[row, best], share[row, best]


class HeadTerms:
    """L_face as a function of the betas and of the face offsets, and the symmetry of these."""

    def __init__(self, body: Body, head: Head):
        rest = body.v_template[head.index]
        self.rest = torch.tensor(rest)
        self.dirs = torch.tensor(body.shapedirs[head.index])
        target = torch.tensor(np.asarray(head.vertices, np.float32))
        self.target = target - target.mean(0)
        edges = np.concatenate([head.faces[:, [0, 1]], head.faces[:, [0, 2]], head.faces[:, [1, 2]]])
        self.edges = torch.tensor(edges)
        pairs = np.unique(np.sort(edges, 1), axis=0)
        both = np.concatenate([pairs, pairs[:, ::-1]])
        degree = np.bincount(both[:, 0], minlength=len(head.vertices))
        self.from_, self.to = torch.tensor(both[:, 0].copy()), torch.tensor(both[:, 1].copy())
        self.share = torch.tensor(1 / np.maximum(degree, 1), dtype=torch.float32)[:, None]
        corners, share = find_closest(rest * MIRROR, rest, head.faces, find_incident_faces(head.faces, len(rest)))[1:]
        self.other_corners, self.other_share = torch.tensor(corners), torch.tensor(share, dtype=torch.float32)

    @property
    def count(self) -> int:
        """N, the head's vertices."""
        return len(self.rest)

    def loss(self, betas: torch.Tensor, face_offset: torch.Tensor) -> torch.Tensor:
        """Weighted sum, a scalar, of vertex L1, Laplacian L2 and edge length L1, each a mean; vertices are centred, and an edge
        counts once for each face. betas: (B,); face_offset: (N, 3) m."""
        x = self.rest + self.dirs @ betas + face_offset
        x = x - x.mean(0)
        vertex = (x - self.target).abs().mean()
        laplacian = ((self._laplacian(x) - self._laplacian(self.target)) ** 2).mean()
        edge = (self._lengths(x) - self._lengths(self.target)).abs().mean()
        return VERTEX * vertex + LAPLACIAN * laplacian + EDGE * edge

    def asymmetry(self, face_offset: torch.Tensor) -> torch.Tensor:
        """L1, summed over xyz, of face_offset (N, 3) m and its mirror image on the other side of the head; a mean over vertices."""
        other = (face_offset[self.other_corners] * self.other_share[..., None]).sum(1)
        return (face_offset - other * torch.tensor(MIRROR, dtype=torch.float32)).abs().sum(1).mean()

    def _laplacian(self, x: torch.Tensor) -> torch.Tensor:
        around = torch.zeros_like(x).index_add(0, self.from_, x[self.to])
        return x - around * self.share

    def _lengths(self, x: torch.Tensor) -> torch.Tensor:
        return (x[self.edges[:, 0]] - x[self.edges[:, 1]]).norm(dim=1)


def faces_camera(centre: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Whether the face looks towards the camera, (T,) bool. centre: (T, 3) m, of the head's vertices; eyes: (T, 3) m, between them;
    camera frame.

    In the camera's xz plane the direction from the centre to the eyes must be more than 135 degrees off the line of sight.
    """
    look, sight = (eyes - centre)[:, [0, 2]], centre[:, [0, 2]]
    cos = (look * sight).sum(1) / np.maximum(np.linalg.norm(look, axis=1) * np.linalg.norm(sight, axis=1), 1e-9)
    return cos < VISIBLE
