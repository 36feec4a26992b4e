"""Body points and their exact derivatives, without skinning the whole mesh.

A point is a weighted sum of skinned vertices. Grouped by joint k it is  x = sum_k G_k m_k + w_k t_k + transl,  where the
moment m_k = sum_v a_v w_vk v is linear in the betas: a few 3-vectors a point instead of 13,718 vertices.
T frames, J joints, A active joints, P points, M (point, joint) pairs, B betas. The S shape unknowns are the B betas and the K
person's own offsets of lm/person_offsets.py.
A step turns joint j by R_j <- R_j exp(delta_j); then dx/ddelta_j = (G_j delta_j) x (the part of x carried by j, about j).
Of a body with pose correctives the moments are linear in the rotations of the joints, too, and a step moves them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.correctives import DIRECTIONS, turn_features
from gsac.avatar.numba_kernel import own_kernel


@dataclass
class Pairs:
    """P points as M (point, joint) pairs; point p owns the pairs `start[p]:start[p + 1]`."""

    start: np.ndarray  # (P + 1,) int64
    joint: np.ndarray  # (M,) int64
    mass: np.ndarray  # (M,)
    moment: np.ndarray  # (M, 3) at zero betas
    moment_dirs: np.ndarray  # (M, 3, S) by the first S shape unknowns
    moment_turns: np.ndarray | None = None  # (M, 3, 486) by the pose correctives' features
    """None where no pose correctives move these points, or where they are part of `moment`."""

    @property
    def count(self) -> int:
        return len(self.start) - 1

    def moments(self, shape: np.ndarray) -> np.ndarray:
        """Moments (M, 3). shape: (S,); unknowns beyond those that move these points are ignored."""
        known = self.moment_dirs.shape[2]
        return self.moment + (self.moment_dirs.reshape(-1, known) @ shape[:known]).reshape(-1, 3)  # one product, not one a pair

    def moments_in(self, chain: Chain, shape: np.ndarray) -> Iterator[np.ndarray]:
        """Moments (M, 3) in each frame of the chain. shape: (S,)."""
        moments = self.moments(shape)
        for local in chain.local:
            yield moments if self.moment_turns is None else moments + self.moment_turns @ turn_features(local)


def make_pairs(body: Body, matrix: sparse.csr_matrix, offsets: np.ndarray | None = None, moves: np.ndarray | None = None) -> Pairs:
    """Pairs of points that are weighted sums of vertices; clothes do not move them.

    matrix: (P, V) weights; offsets: (P, 3) m added in the axes of the point's heaviest joint; moves: (P, 3, B + K) slopes of the
    offsets by the shape unknowns.
    """
    matrix = matrix.tocsr()
    moves = np.zeros((matrix.shape[0], 3, body.num_betas)) if moves is None else moves
    start, joint, mass, moment, dirs, turns, added = [0], [], [], [], [], [], []
    for p in range(matrix.shape[0]):
        span = slice(matrix.indptr[p], matrix.indptr[p + 1])
        vertices, a = matrix.indices[span], matrix.data[span].astype(np.float64)
        carried = a[:, None] * body.weights[vertices]  # (n, 55)
        heaviest = np.abs(carried).sum(0).argmax()
        for k in np.nonzero(np.abs(carried).sum(0) > 1e-4)[0]:
            w = carried[:, k]
            joint.append(k)
            mass.append(w.sum())
            moment.append(w @ body.v_template[vertices] + (offsets[p] if offsets is not None and k == heaviest else 0))
            dirs.append(np.tensordot(w, body.shapedirs[vertices], 1))
            if body.posedirs is not None:
                turns.append(np.tensordot(w, body.posedirs[vertices], 1))
            added.append(moves[p] * (k == heaviest))
        start.append(len(joint))
    added = np.array(added).reshape(-1, *moves.shape[1:])
    added[:, :, : body.num_figure] += np.array(dirs).reshape(-1, 3, body.num_betas)[:, :, : body.num_figure]
    return Pairs(np.array(start), np.array(joint, np.int64), np.array(mass), np.array(moment).reshape(-1, 3), added,
                 None if body.posedirs is None else np.array(turns).reshape(-1, 3, DIRECTIONS))


def make_surface_pairs(body: Body, face: np.ndarray, bary: np.ndarray, pose: np.ndarray | None = None) -> Pairs:
    """Pairs of points on the surface: face (P,), bary (P, 3). Twelve pairs a point, some of weight 0.

    pose: (55, 3) axis-angle, the one whose pose correctives the points keep; none unless given.
    """
    rest = body.v_template if pose is None else body.correct(body.v_template, pose)
    vertices = body.faces[face]  # (P, 3)
    w = bary[:, :, None] * body.skin_weight[vertices]  # (P, 3, 4)
    mass = w.reshape(-1).astype(np.float64)
    vertex = np.repeat(vertices.reshape(-1), 4)
    return Pairs(np.arange(len(face) + 1) * 12, body.skin_index[vertices].reshape(-1).astype(np.int64), mass,
                 mass[:, None] * rest[vertex], mass[:, None, None] * body.shapedirs[vertex])


class Skeleton:
    """Joint chain of one body, with its derivatives."""

    def __init__(self, body: Body, active: np.ndarray, joint_moves: np.ndarray | None = None):
        """active: (A,) joints that the fit turns; joint_moves: (J, 3, K) slopes of the joints by the unknowns after the betas."""
        self.parents = np.asarray(body.parents, np.int64)
        self.active = np.asarray(active, np.int64)  # (A,)
        self.rest = (body.J_regressor @ body.v_template).astype(np.float64)  # (J, 3)
        self.rest_dirs = np.einsum("jv,vcb->jcb", body.J_regressor, body.shapedirs).astype(np.float64)
        if joint_moves is not None:
            self.rest_dirs = np.concatenate([self.rest_dirs, joint_moves], 2)
        carries = np.eye(len(self.parents), dtype=bool)
        for j, p in enumerate(self.parents):
            if p >= 0:
                carries[j] |= carries[p]
        self.carries = carries[:, self.active]  # (J, A) bool: the active joint is the joint or above it

    def pose(self, local: np.ndarray, shape: np.ndarray) -> Chain:
        """Poses the chain in every frame. local: (T, J, 3, 3) joint rotations; shape: (S,)."""
        shape = shape[: self.rest_dirs.shape[2]]
        rest = self.rest + self.rest_dirs @ shape
        world, place, dirs = local.copy(), np.empty((*local.shape[:2], 3)), np.empty((*local.shape[:2], 3, len(shape)))
        place[:, 0], dirs[:, 0] = rest[0], self.rest_dirs[0]
        for j, p in enumerate(self.parents[1:], 1):
            world[:, j] = world[:, p] @ local[:, j]
            place[:, j] = place[:, p] + world[:, p] @ (rest[j] - rest[p])
            dirs[:, j] = dirs[:, p] + world[:, p] @ (self.rest_dirs[j] - self.rest_dirs[p])
        shift = place - np.einsum("tjab,jb->tja", world, rest)
        shift_dirs = dirs - np.einsum("tjab,jbc->tjac", world, self.rest_dirs)
        return Chain(local, world, place, shift, shift_dirs)


@dataclass
class Chain:
    """T posed skeletons."""

    local: np.ndarray  # (T, J, 3, 3) joint to parent, rotations
    world: np.ndarray  # (T, J, 3, 3) joint to camera, rotations
    place: np.ndarray  # (T, J, 3) m, joints without transl
    shift: np.ndarray  # (T, J, 3): skinned = world @ rest + shift
    shift_dirs: np.ndarray  # (T, J, 3, S) by the first S shape unknowns

    def frame(self, t: int) -> Chain:
        """The chain of one frame alone."""
        one = slice(t, t + 1)
        return Chain(self.local[one], self.world[one], self.place[one], self.shift[one], self.shift_dirs[one])


def place_points(chain: Chain, pairs: Pairs, shape: np.ndarray) -> np.ndarray:
    """The pairs' points (T, P, 3) m in every frame, without transl. shape: (S,)."""
    if pairs.moment_turns is None:
        return _place_points(pairs.start, pairs.joint, pairs.mass, pairs.moments(shape), chain.world, chain.shift)
    return np.concatenate([_place_points(pairs.start, pairs.joint, pairs.mass, moment, chain.world[t:t + 1], chain.shift[t:t + 1])
                           for t, moment in enumerate(pairs.moments_in(chain, shape))])


def pull_back(skeleton: Skeleton, chain: Chain, pairs: Pairs, shape: np.ndarray, covectors: np.ndarray) -> np.ndarray:
    """Rows of the Jacobian: derivatives of g . x for R covectors g of every point x.

    shape: (S,); covectors: (T, P, R, 3). Returns (T, P, R, 3 A + 3 + S): by joint steps, transl and the shape unknowns that move x.
    """
    size = max(pairs.moment_dirs.shape[2], chain.shift_dirs.shape[3])
    rows = np.zeros((*covectors.shape[:3], 3 * len(skeleton.active) + 3 + size))
    for t, (g, moment) in enumerate(zip(covectors, pairs.moments_in(chain, shape), strict=True)):
        _pull_back(pairs.start, pairs.joint, pairs.mass, moment, pairs.moment_dirs, chain.world[t], chain.place[t],
                     chain.shift[t], chain.shift_dirs[t], skeleton.active, skeleton.carries, g, rows[t])
        if pairs.moment_turns is not None:
            rows[t, ..., : 3 * len(skeleton.active)] += g @ _slopes_of_correctives(skeleton, chain.local[t], chain.world[t], pairs)
    return rows


def _slopes_of_correctives(skeleton: Skeleton, local: np.ndarray, world: np.ndarray, pairs: Pairs) -> np.ndarray:
    """(P, 3, 3 A) by joint steps, of the points as their pose correctives alone move. local, world: (J, 3, 3), of one frame."""
    turned = (world[pairs.joint] @ pairs.moment_turns).reshape(-1, 3, len(local) - 1, 9)
    by_feature = np.zeros((pairs.count, *turned.shape[1:]))
    np.add.at(by_feature, np.repeat(np.arange(pairs.count), np.diff(pairs.start)), turned)
    by_step = np.einsum("jab,dbc->jacd", local, rotation.hat(np.eye(3))).reshape(-1, 9, 3)
    out = np.zeros((pairs.count, 3, len(skeleton.active), 3))
    bends = skeleton.active > 0  # the root has no correctives
    joints = skeleton.active[bends]
    out[:, :, bends] = np.einsum("pcaf,afd->pcad", by_feature[:, :, joints - 1], by_step[joints])
    return out.reshape(pairs.count, 3, -1)


@own_kernel(nogil=True)
def _place_points(start, joint, mass, moment, world, shift):
    x = np.zeros((len(world), len(start) - 1, 3))
    for t in range(len(world)):
        for p in range(x.shape[1]):
            for m in range(start[p], start[p + 1]):
                g, k = world[t, joint[m]], joint[m]
                for c in range(3):
                    x[t, p, c] += (g[c, 0] * moment[m, 0] + g[c, 1] * moment[m, 1] + g[c, 2] * moment[m, 2]
                                   + mass[m] * shift[t, k, c])
    return x


@own_kernel(nogil=True)
def _pull_back(start, joint, mass, moment, moment_dirs, world, place, shift, shift_dirs, active, carries, covectors, rows):
    points, joints, size = len(start) - 1, len(active), rows.shape[2] - 3 * len(active) - 3
    own, shaped = moment_dirs.shape[2], shift_dirs.shape[2]
    arm = np.zeros((joints, 3))
    by_shape = np.zeros((3, size))
    for p in range(points):
        arm[:] = 0
        by_shape[:] = 0
        for m in range(start[p], start[p + 1]):
            w = mass[m]
            if w == 0.0:
                continue
            k = joint[m]
            g = world[k]
            for c in range(3):
                part = g[c, 0] * moment[m, 0] + g[c, 1] * moment[m, 1] + g[c, 2] * moment[m, 2] + w * shift[k, c]
                for a in range(joints):
                    if carries[k, a]:
                        arm[a, c] += part - w * place[active[a], c]
                for b in range(own):
                    by_shape[c, b] += (g[c, 0] * moment_dirs[m, 0, b] + g[c, 1] * moment_dirs[m, 1, b]
                                       + g[c, 2] * moment_dirs[m, 2, b])
                for b in range(shaped):
                    by_shape[c, b] += w * shift_dirs[k, c, b]
        for r in range(covectors.shape[1]):
            v = covectors[p, r]
            for a in range(joints):
                x = arm[a, 1] * v[2] - arm[a, 2] * v[1]
                y = arm[a, 2] * v[0] - arm[a, 0] * v[2]
                z = arm[a, 0] * v[1] - arm[a, 1] * v[0]
                g = world[active[a]]
                for d in range(3):
                    rows[p, r, 3 * a + d] = g[0, d] * x + g[1, d] * y + g[2, d] * z
            for c in range(3):
                rows[p, r, 3 * joints + c] = v[c]
            for b in range(size):
                rows[p, r, 3 * joints + 3 + b] = v[0] * by_shape[0, b] + v[1] * by_shape[1, b] + v[2] * by_shape[2, b]
