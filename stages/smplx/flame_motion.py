"""FLAME's expression and jaw as an SMPL-X body acts them: the vertices that both share move alike.

The two models' expression coefficients mean different things, so none is copied. For each frame the body's expression and jaw are
sought whose motion of the head's vertices is nearest to FLAME's, at the person's shapes (ExAvatar takes the same way, through
`SMPL-X__FLAME_vertex_ids.npy`, which SMPL-X's site hands out).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.flame_file import Flame, read_flame, read_flame_ids
from gsac.avatar.joints import JAW
from gsac.stages.body_choice import OPEN
from gsac.stages.brought_file import NONE, read_brought
from gsac.stages.contract import BadInput, Job

FLAME_JAW = 2
"""FLAME's jaw joint."""
STEPS = 5
"""Gauss-Newton steps of a frame; the motion is nearly linear."""
TURN = 1e-4
"""rad, of the jaw's numeric derivative."""
MOVING = 1e-6
"""m a unit, or a skin weight: what moves less belongs to the back of the head."""
CALM = 1e-9
"""Share of the normal equations' mean diagonal that is added to it: directions that nothing tells stay 0."""


@dataclass
class JawedHead:
    """N vertices of a head that is moved by expressions and by the jaw alone."""

    rest: np.ndarray  # (N, 3) m, at the person's shape
    directions: np.ndarray  # (N, 3, E) m a unit
    jaw_weight: np.ndarray  # (N,)
    jaw: np.ndarray  # (3,) m, the joint
    corrective: np.ndarray  # (N, 3, 9) m for each number of the jaw's rotation less the identity

    @classmethod
    def of_flame(cls, flame: Flame, rest: np.ndarray, expressions: int) -> JawedHead:
        """FLAME at the person's shape. rest: (5023, 3) m; expressions: E, leading ones."""
        return cls(rest.astype(float), flame.exprdirs[:, :, :expressions].astype(float), flame.weights[:, FLAME_JAW].astype(float),
                   flame.J_regressor[FLAME_JAW] @ rest, flame.posedirs[:, :, 9 * (FLAME_JAW - 1):9 * FLAME_JAW].astype(float))

    @classmethod
    def of_body(cls, body: Body, betas: np.ndarray, index: np.ndarray) -> JawedHead:
        """The body's head at the person's shape. betas: (B,); index: (N,) vertices."""
        vertices, joints = body.rest(betas)
        corrective = np.zeros((len(index), 3, 9))
        if body.posedirs is not None:
            corrective += body.posedirs[index, :, 9 * (JAW - 1):9 * JAW]
        return cls(vertices[index].astype(float), body.exprdirs[index].astype(float), body.weights[index, JAW].astype(float),
                   joints[JAW].astype(float), corrective)

    def take(self, index: np.ndarray) -> JawedHead:
        """Some of the vertices. index: (n,)."""
        return JawedHead(self.rest[index], self.directions[index], self.jaw_weight[index], self.jaw, self.corrective[index])

    @property
    def moving(self) -> np.ndarray:
        """(N,) bool, vertices that expression or jaw move."""
        return (np.abs(self.directions).max((1, 2)) > MOVING) | (self.jaw_weight > MOVING)

    def moves(self, expression: np.ndarray, jaw: np.ndarray) -> np.ndarray:
        """Displacements (N, 3) m from rest, in the head's axes. expression: (E,); jaw: (3,) rad."""
        turn = rotation.exp(jaw) - np.eye(3)
        moved = self.directions @ expression + self.corrective @ turn.ravel()
        return moved + self.jaw_weight[:, None] * ((self.rest + moved - self.jaw) @ turn.T)

    def slopes(self, expression: np.ndarray, jaw: np.ndarray) -> np.ndarray:
        """Derivative (N, 3, E + 3) m of `moves` by expression (E,) and jaw (3,) rad."""
        turn = np.eye(3) + self.jaw_weight[:, None, None] * (rotation.exp(jaw) - np.eye(3))
        by_expression = np.einsum("nab,nbe->nae", turn, self.directions)
        here = self.moves(expression, jaw)
        by_jaw = [(self.moves(expression, jaw + TURN * axis) - here) / TURN for axis in np.eye(3)]
        return np.concatenate([by_expression, np.stack(by_jaw, -1)], 2)


def translate_flame(body: Body, betas: np.ndarray, flame: Flame, ids: np.ndarray, head: np.ndarray, expression: np.ndarray,
                    jaw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The body's expression (T, E) and jaw_pose (T, 3) rad that move it as FLAME moves.

    betas: (B,); ids: (5023,) the body's vertices that are FLAME's; head: (5023, 3) m, the person's FLAME head at rest;
    expression: (T, X) and jaw: (T, 3) rad, FLAME's.
    """
    theirs, ours = JawedHead.of_flame(flame, head, expression.shape[1]), JawedHead.of_body(body, betas, ids)
    used = np.flatnonzero(theirs.moving | ours.moving)
    theirs, ours = theirs.take(used), ours.take(used)
    size = ours.directions.shape[2]
    out = np.zeros((len(expression), size + 3))
    for t in range(len(expression)):
        wanted = theirs.moves(expression[t].astype(float), jaw[t].astype(float))
        out[t] = follow(ours, wanted)
    return out[:, :size].astype(np.float32), out[:, size:].astype(np.float32)


def follow(head: JawedHead, wanted: np.ndarray) -> np.ndarray:
    """Expression and jaw (E + 3,) whose displacements are nearest to the wanted ones (N, 3) m, by Gauss and Newton's steps."""
    found = np.zeros(head.directions.shape[2] + 3)
    for _ in range(STEPS):
        expression, jaw = found[:-3], found[-3:]
        slope = head.slopes(expression, jaw).reshape(-1, len(found))
        normal = slope.T @ slope
        normal[np.diag_indices_from(normal)] += CALM * np.trace(normal) / len(normal)
        found = found + np.linalg.solve(normal, slope.T @ (wanted - head.moves(expression, jaw)).ravel())
    return found


def read_shared(job: Job, body: Body) -> tuple[Flame, np.ndarray] | None:
    """The user's FLAME head and (5023,) the body's vertices that are its; None without `smplx.flame`."""
    if job.config.flame == NONE:
        return None
    if job.config.body_model == OPEN:
        raise BadInput("smplx.flame is given, but smplx.body_model is open, whose face acts the facial actions; leave it out, or "
                       "give an SMPL-X body")
    flame = read_brought(job, "smplx", "flame", read_flame)
    ids = read_brought(job, "smplx", "flame_ids", read_flame_ids)
    if ids.max() >= len(body.v_template):
        raise BadInput(f"smplx.flame_ids is {job.config.flame_ids}: it names vertex {ids.max()}, but the body model "
                       f"{job.config.body_model} has {len(body.v_template)}; both must be of SMPL-X")
    return flame, ids
