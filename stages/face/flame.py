"""A FLAME head that the user brings: the person's head in its mesh, expression and jaw from the facial actions.

What an action does to the network's points is known (`Actions.response`); which expression and jaw do the same to FLAME's is a
linear problem, solved once, so that FLAME's face is as calm as the actions are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.flame_file import Flame, FlamePoints, read_flame, read_flame_points
from gsac.avatar.rotation import hat
from gsac.stages.contract import BadInput, Job
from gsac.stages.face.actions import Actions
from gsac.stages.face.config import NONE
from gsac.stages.face.head import AXES, HeadModel

SHAPES, EXPRESSIONS = 100, 50
"""Leading directions that are used; their coefficients have a spread of one."""
ACTION_NOISE = 0.0005
"""m: how well the motion of a resting point is known."""
JAW, JAW_SPREAD = 2, 0.2
"""FLAME's jaw joint, and how far it turns, rad."""


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

    @property
    def model(self) -> HeadModel:
        flame, points = self.flame, self.points
        return HeadModel(flame.v_template, flame.faces, flame.shapedirs[:, :, :SHAPES], flame.J_regressor[3:] @ flame.v_template,
                         points.index, flame.faces[points.face], points.bary)

    def arrays(self, rest: np.ndarray, actions: Actions, expression: np.ndarray) -> dict[str, np.ndarray]:
        """rest: (468, 3) m, the person's resting points; expression: (T, E) the person's actions.

        Returns what face.npz holds besides.
        """
        model = self.model
        shape, turn, size = model.shape_of(rest)
        found = model.arrays(shape)
        moved = expression @ self.mimicry(found["head_vertices"], actions.response[0] / 1e3, turn, size)
        return found | {"flame_expression": moved[:, :-3].astype(np.float32), "flame_jaw": moved[:, -3:].astype(np.float32)}

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
