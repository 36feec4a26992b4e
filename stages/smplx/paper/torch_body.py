"""Skeleton, points and vertices of the body as torch functions of the unknowns.

T frames, J joints, P points, V vertices, B betas. A point is  x = sum_k G_k m_k + w_k t_k  with its moment m_k
and mass w_k on joint k; here over all joints, so that T frames of P points are one matrix product.
`local`: (T, J, 3, 3) rotations of the joints against their parents; `world`: (T, J, 3, 3) against the camera;
`place`: (T, J, 3) m, posed joints without transl; `rest`: (J, 3) m, resting joints.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy import sparse

from gsac.avatar.body import Body
from gsac.avatar.correctives import DIRECTIONS


def to_matrices(six: torch.Tensor) -> torch.Tensor:
    """Rotations (..., 3, 3) from six (..., 6), their first two columns, not normalised (Zhou et al. 2019)."""
    a, b = six[..., :3], six[..., 3:]
    x = torch.nn.functional.normalize(a, dim=-1)
    y = torch.nn.functional.normalize(b - (x * b).sum(-1, keepdim=True) * x, dim=-1)
    return torch.stack([x, y, torch.linalg.cross(x, y)], -1)


def to_six(rotation: torch.Tensor) -> torch.Tensor:
    """The first two columns (..., 6) of a rotation (..., 3, 3)."""
    return torch.cat([rotation[..., 0], rotation[..., 1]], -1)


def to_vectors(rotation: torch.Tensor) -> torch.Tensor:
    """Rotation vectors (..., 3) rad of a rotation (..., 3, 3) by less than pi."""
    r = rotation
    axis = torch.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], -1) / 2
    cos = ((r.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2).clamp(-0.999, 1 - 1e-6)
    angle = torch.arccos(cos)
    return axis * (angle / torch.sin(angle))[..., None]


class Kinematics:
    """One body's joint chain."""

    def __init__(self, body: Body):
        self.parents = [int(p) for p in body.parents]
        rest = body.J_regressor @ body.v_template
        self.rest = torch.tensor(rest, dtype=torch.float32)  # (J, 3)
        self.rest_dirs = torch.tensor(np.einsum("jv,vcb->jcb", body.J_regressor, body.shapedirs), dtype=torch.float32)
        depth = np.zeros(len(self.parents), int)
        for j, p in enumerate(self.parents[1:], 1):
            depth[j] = depth[p] + 1
        self.levels = [np.flatnonzero(depth == d).tolist() for d in range(depth.max() + 1)]
        self.order = torch.tensor(np.argsort(np.concatenate(self.levels)))

    def joints(self, betas: torch.Tensor, joint_offset: torch.Tensor) -> torch.Tensor:
        """Resting joints (J, 3) m. betas: (B,); joint_offset: (J, 3) m."""
        return self.rest + self.rest_dirs @ betas + joint_offset

    def pose(self, local: torch.Tensor, rest: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """World rotations (T, J, 3, 3) and places (T, J, 3) m. local: (T, J, 3, 3); rest: (J, 3) m."""
        worlds, places = [local[:, :1]], [rest[None, :1].expand(len(local), 1, 3)]
        for before, level in zip(self.levels, self.levels[1:], strict=False):
            above = [before.index(self.parents[j]) for j in level]
            parents = [self.parents[j] for j in level]
            turn = worlds[-1][:, above]
            bone = (rest[level] - rest[parents])[None, :, :, None]
            places.append(places[-1][:, above] + (turn @ bone)[..., 0])
            worlds.append(turn @ local[:, level])
        return torch.cat(worlds, 1)[:, self.order], torch.cat(places, 1)[:, self.order]


def turn_features(world: torch.Tensor, parents: np.ndarray) -> torch.Tensor:
    """(T, 486), as correctives.py's: the joints' rotations against their parents less the identity. world: (T, J, 3, 3); parents:
    (J,)."""
    local = world[:, parents[1:]].transpose(-1, -2) @ world[:, 1:]
    return (local - torch.eye(3)).flatten(1)


class Points:
    """P points of the body as moments over all joints."""

    def __init__(self, body: Body, matrix: sparse.csr_matrix, offsets: np.ndarray | None = None, head: np.ndarray | None = None):
        """matrix: (P, V) weights of the points over the vertices; offsets: (P, 3) m, in the axes of each point's heaviest joint;
        head: (N,) vertices that may have offsets of their own, or none."""
        matrix = matrix.tocsr()
        points, joints = matrix.shape[0], body.weights.shape[1]
        mass = np.asarray(matrix @ body.weights)
        moment = np.stack([matrix @ (body.weights * body.v_template[:, c:c + 1]) for c in range(3)], -1)
        if offsets is not None:
            moment[np.arange(points), np.abs(mass).argmax(1)] += offsets
        dirs = np.zeros((points, joints, 3, body.num_betas), np.float32)
        for p in range(points):
            span = slice(matrix.indptr[p], matrix.indptr[p + 1])
            vertices = matrix.indices[span]
            dirs[p] = np.einsum("v,vk,vcb->kcb", matrix.data[span], body.weights[vertices], body.shapedirs[vertices])
        dirs[..., body.num_figure:] = 0  # clothes do not move a person's points
        self.mass = torch.tensor(mass, dtype=torch.float32)  # (P, J)
        self.moment = torch.tensor(moment, dtype=torch.float32).flatten(1)  # (P, 3 J)
        self.dirs = torch.tensor(dirs).flatten(1, 2)  # (P, 3 J, B)
        self.parents = np.asarray(body.parents)
        self.turns = None  # (P, 3 J, 486)
        if body.posedirs is not None:
            self.turns = torch.tensor(_moments_of_correctives(body.weights, body.posedirs, matrix))
        if head is not None:
            share = matrix[:, head].toarray()
            self.moved = torch.tensor(np.flatnonzero(share.any(0)))  # (M,) of the head's vertices, those that points lie on
            carried = share[:, None, self.moved] * body.weights[head[self.moved]].T  # (P, J, M)
            self.carried = torch.tensor(carried, dtype=torch.float32)

    def at(self, world: torch.Tensor, place: torch.Tensor, rest: torch.Tensor, betas: torch.Tensor,
           face_offset: torch.Tensor | None = None) -> torch.Tensor:
        """Points (T, P, 3) m without transl. world: (T, J, 3, 3); place: (T, J, 3) m; rest: (J, 3) m; betas: (B,); face_offset:
        (N, 3) m of the head's vertices, or none."""
        moment = self.moment + self.dirs @ betas
        if face_offset is not None:
            moment = moment + (self.carried @ face_offset[self.moved]).flatten(1)
        shift = place - (world @ rest[None, :, :, None])[..., 0]
        rows = world.transpose(1, 2).flatten(2)  # (T, 3, 3 J)
        turned = (rows @ moment.T).transpose(1, 2)  # (T, P, 3)
        if self.turns is not None:
            bent = turn_features(world, self.parents) @ self.turns.flatten(0, 1).T
            turned = turned + torch.einsum("tcm,tpm->tpc", rows, bent.unflatten(1, self.turns.shape[:2]))
        return turned + self.mass @ shift


class Mesh:
    """All vertices of the body by linear blend skinning, T frames as one matrix product over the joints."""

    def __init__(self, body: Body):
        self.template = torch.tensor(body.v_template, dtype=torch.float32)  # (V, 3)
        self.dirs = torch.tensor(body.shapedirs, dtype=torch.float32)  # (V, 3, B)
        self.weights = torch.tensor(body.weights.T.copy(), dtype=torch.float32)  # (J, V)
        self.parents = np.asarray(body.parents)
        self.turns = None if body.posedirs is None else torch.tensor(body.posedirs.transpose(1, 0, 2).reshape(-1, DIRECTIONS))

    def at(self, world: torch.Tensor, place: torch.Tensor, rest: torch.Tensor, betas: torch.Tensor) -> torch.Tensor:
        """Vertices (T, 3, V) m without transl. world: (T, J, 3, 3); place: (T, J, 3) m; rest: (J, 3) m; betas: (B,)."""
        vertices = (self.template + self.dirs @ betas).T  # (3, V)
        moment = (self.weights[:, None] * vertices).flatten(0, 1)  # (3 J, V)
        shift = place - (world @ rest[None, :, :, None])[..., 0]
        rows = world.transpose(1, 2)  # (T, 3, J, 3)
        skinned = rows.flatten(2) @ moment + shift.transpose(1, 2) @ self.weights
        if self.turns is None:
            return skinned
        bent = (turn_features(world, self.parents) @ self.turns.T).unflatten(1, (3, -1))  # (T, 3, V) at rest
        return skinned + torch.stack([(rows[..., c] @ self.weights) * bent[:, None, c] for c in range(3)]).sum(0)


def _moments_of_correctives(weights: np.ndarray, posedirs: np.ndarray, matrix: sparse.csr_matrix) -> np.ndarray:
    """(P, 3 J, 486) by the pose correctives' features.

    weights: (V, J); posedirs: (V, 3, 486) m; matrix: (P, V) weights of the points over the vertices.
    """
    out = np.zeros((len(matrix.indptr) - 1, weights.shape[1], 3, DIRECTIONS), np.float32)
    for p in range(len(out)):
        span = slice(matrix.indptr[p], matrix.indptr[p + 1])
        vertices = matrix.indices[span]
        out[p] = np.einsum("vk,vcf->kcf", matrix.data[span, None] * weights[vertices], posedirs[vertices], optimize=True)
    return out.reshape(len(out), -1, DIRECTIONS)
