"""A FLAME head that the user brings: the person's head as its mesh, its expression and jaw from the facial actions.

The effect of an action on the network's points is known (`Actions.response`). The FLAME expression and jaw with the same effect are
a linear problem, solved once for each action, so FLAME's face is as calm as the actions are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.flame_file import Flame, FlamePoints, read_flame, read_flame_points
from gsac.avatar.rotation import hat
from gsac.stages.brought_file import NONE, read_brought
from gsac.stages.contract import Job
from gsac.stages.face.actions import Actions
from gsac.stages.face.head import AXES, HeadModel

SHAPES, EXPRESSIONS = 100, 50
"""Number of leading directions that are used; their coefficients have a standard deviation of 1."""
ACTION_NOISE = 0.0005
"""Standard deviation of a point's motion by an action, m."""
JAW, JAW_SPREAD = 2, 0.2
"""FLAME's jaw joint, and the standard deviation of its turn, rad."""


@dataclass
class FlameHead:
    """FLAME's file and the file of its landmarks, as the user brought them."""

    flame: Flame
    points: FlamePoints

    @classmethod
    def of(cls, job: Job) -> FlameHead | None:
        """None without `face.flame`. Raises BadInput that names the parameter and the fault of its file."""
        if job.config.flame == NONE:
            return None
        return cls(read_brought(job, "face", "flame", read_flame), read_brought(job, "face", "flame_points", read_flame_points))

    @property
    def model(self) -> HeadModel:
        flame, points = self.flame, self.points
        return HeadModel(flame.v_template, flame.faces, flame.shapedirs[:, :, :SHAPES], flame.J_regressor[3:] @ flame.v_template,
                         points.index, flame.faces[points.face], points.bary)

    def arrays(self, rest: np.ndarray, actions: Actions, expression: np.ndarray) -> dict[str, np.ndarray]:
        """rest: (468, 3) m, the person's resting points; expression: (T, E) the person's actions.

        Returns the arrays of face.npz that `HEAD_SHAPES` and `FLAME_SHAPES` name.
        """
        model = self.model
        shape, turn, size = model.fit_shape(rest)
        found = model.arrays(shape)
        moved = expression @ self.response(found["head_vertices"], actions.response[0] / 1e3, turn, size)
        return found | {"flame_expression": moved[:, :-3].astype(np.float32), "flame_jaw": moved[:, -3:].astype(np.float32)}

    def encoded(self, shape: np.ndarray, expression: np.ndarray, jaw: np.ndarray) -> dict[str, np.ndarray]:
        """The same arrays of a head whose FLAME parameters are known: shape (SHAPES,), expression (T, EXPRESSIONS), jaw (T, 3)."""
        return self.model.arrays(shape) | {"flame_expression": expression.astype(np.float32), "flame_jaw": jaw.astype(np.float32)}

    def response(self, head: np.ndarray, response: np.ndarray, turn: np.ndarray, size: float) -> np.ndarray:
        """head: (5023, 3) m at rest; response: (A, 468, 3) m of the network's points to each action; turn: (3, 3) and size: from
        FLAME to those points.

        Returns (A, EXPRESSIONS + 3): expression, and jaw in rad, with the effect of each action at 1.
        """
        flame = self.flame
        arm = head - flame.J_regressor[JAW] @ head
        turned = np.stack([hat(axis) for axis in np.eye(3)])  # derivative of the rotation by a small turn about each axis
        jaw = flame.weights[:, JAW, None, None] * np.einsum("xab,vb->vax", turned, arm)
        jaw = jaw + np.einsum("vak,xk->vax", flame.posedirs[:, :, 9 * (JAW - 1): 9 * JAW], turned.reshape(3, 9))
        directions = self.points.on(flame, np.concatenate([flame.exprdirs[:, :, :EXPRESSIONS], jaw], 2)).astype(float)
        columns = (size * np.einsum("ab,lbs->las", turn, directions) * AXES[:, None]).reshape(-1, EXPRESSIONS + 3)
        wanted = (response[:, self.points.index] * AXES).reshape(len(response), -1)
        spread = np.append(np.ones(EXPRESSIONS), [JAW_SPREAD] * 3)
        doubt = ACTION_NOISE**2 * np.diag(1 / spread**2)
        return np.linalg.solve(columns.T @ columns + doubt, columns.T @ wanted.T).T
