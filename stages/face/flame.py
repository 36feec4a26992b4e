"""A FLAME head for the person: shape from the resting face's points, expression and jaw from the facial actions.

A network's points have no size of their own, so shape is found up to a similarity and the head keeps FLAME's metres. What an
action does to the points is known (`Actions.response`); which expression and jaw do the same to FLAME's is a linear problem,
solved once, so that FLAME's face is as calm as the actions are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.flame_file import Flame, FlamePoints, read_flame, read_flame_points
from gsac.avatar.rotation import hat
from gsac.stages.contract import BadInput, Job
from gsac.stages.face.actions import AXES, Actions
from gsac.stages.face.config import NONE

SHAPES, EXPRESSIONS = 100, 50
"""Leading directions that are used; their coefficients have a spread of one."""
POINT_NOISE, ACTION_NOISE = 0.002, 0.0005
"""m: how well a resting point, and how well the motion of one, is known."""
JAW, JAW_SPREAD = 2, 0.2
"""FLAME's jaw joint, and how far it turns, rad."""
ROUNDS = 10


@dataclass
class FlameHead:
    """What is brought."""

    flame: Flame
    points: FlamePoints

    @classmethod
    def of(cls, job: Job) -> FlameHead | None:
        """None without `face.flame`. Raises BadInput that names the parameter and what is wrong with its file."""
        read = {}
        for name, reader in (("flame", read_flame), ("flame_points", read_flame_points)):
            if job.config.flame == NONE:
                return None
            try:
                read[name] = reader(job.models[getattr(job.config, name)])
            except ArtifactError as e:
                raise BadInput(f"face.{name} is {getattr(job.config, name)}: {e}") from e
        return cls(read["flame"], read["flame_points"])

    def arrays(self, offset: np.ndarray, actions: Actions, expression: np.ndarray) -> dict[str, np.ndarray]:
        """offset: (468, 3) m, the person's resting points less `actions.neutral`; expression: (T, E) the person's actions.

        Returns what face.npz holds besides.
        """
        shape, turn, size = self.shape_of(actions.neutral + offset)
        head = self.flame.rest(shape)
        mimicry = self.mimicry(head, actions.response / 1e3, turn, size)
        moved = expression @ mimicry
        return {"head_template": self.flame.v_template, "head_vertices": head.astype(np.float32), "head_faces": self.flame.faces,
                "head_eyes": (self.flame.J_regressor[3:] @ self.flame.v_template).astype(np.float32),
                "flame_expression": moved[:, :-3].astype(np.float32), "flame_jaw": moved[:, -3:].astype(np.float32)}

    def shape_of(self, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """rest: (468, 3) m, y up, z out of the face. Returns the likeliest shape (SHAPES,) and turn (3, 3) and size that bring
        FLAME's points onto these."""
        target = rest[self.points.index]
        mean = self.points.on(self.flame, self.flame.v_template).astype(float)
        ways = self.points.on(self.flame, self.flame.shapedirs[:, :, :SHAPES]).astype(float)
        shape = np.zeros(SHAPES)
        for _ in range(ROUNDS):
            points = mean + ways @ shape
            turn, size, shift = similarity(points, target)
            columns = (size * np.einsum("ab,lbs->las", turn, ways) * AXES[:, None]).reshape(-1, SHAPES)
            missing = ((target - shift - size * mean @ turn.T) * AXES).ravel()
            shape = np.linalg.solve(columns.T @ columns + POINT_NOISE**2 * np.eye(SHAPES), columns.T @ missing)
        return shape, turn, size

    def mimicry(self, head: np.ndarray, response: np.ndarray, turn: np.ndarray, size: float) -> np.ndarray:
        """head: (5023, 3) m at rest; response: (A, 468, 3) m of the network's points to each action.

        Returns (A, EXPRESSIONS + 3): expression and jaw, rad, of each action at full.
        """
        flame = self.flame
        arm = head - flame.J_regressor[JAW] @ head
        turned = np.stack([hat(axis) for axis in np.eye(3)])  # what a small turn about each axis does
        jaw = flame.weights[:, JAW, None, None] * np.einsum("xab,vb->vax", turned, arm)
        jaw = jaw + np.einsum("vak,xk->vax", flame.posedirs[:, :, 9 * (JAW - 1): 9 * JAW], turned.reshape(3, 9))
        ways = self.points.on(flame, np.concatenate([flame.exprdirs[:, :, :EXPRESSIONS], jaw], 2)).astype(float)
        columns = (size * np.einsum("ab,lbs->las", turn, ways) * AXES[:, None]).reshape(-1, EXPRESSIONS + 3)
        said = (response[:, self.points.index] * AXES).reshape(len(response), -1)
        spread = np.append(np.ones(EXPRESSIONS), [JAW_SPREAD] * 3)
        doubt = ACTION_NOISE**2 * np.diag(1 / spread**2)
        return np.linalg.solve(columns.T @ columns + doubt, columns.T @ said.T).T


def similarity(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """(n, 3) both. Turn (3, 3), size and shift (3,) that bring source nearest to target (Umeyama)."""
    a, b = source - source.mean(0), target - target.mean(0)
    u, spread, vt = np.linalg.svd(b.T @ a)
    signs = np.array([1, 1, np.sign(np.linalg.det(u @ vt))])
    turn = (u * signs) @ vt
    size = float((spread * signs).sum() / max((a**2).sum(), 1e-12))
    return turn, size, target.mean(0) - size * turn @ source.mean(0)
