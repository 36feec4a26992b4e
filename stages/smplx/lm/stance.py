"""Priors of a turning clip: the person stands upright and keeps one pose.

One view leaves open how far a body and its limbs lean along the line of sight; views from the other sides show it. So the rotation
of each joint has a mean over the clip, and so has the lean of the pelvis against the upright. The means are unknowns of the clip;
the spreads (standard deviations) of the frames about them are learned from the fit. Moving parts are released: legs and trunk
together, and each arm with them or alone.
T frames, A active joints, the pelvis first. The vector `stance` holds H = 3 A + 2 unknowns: the pelvis' lean towards x, an unused
one, its lean towards z; the other joints' rotation vectors; the upright as camera-frame slopes towards x and z.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.stages.smplx.lm.solver import System
from gsac.stages.smplx.prior import pose_prior

TRUNK, ARMS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 15), ((13, 16, 18, 20), (14, 17, 19, 21))
"""Joints that are held or released together."""
MOVERS = (1, 2, 4, 5, 16, 17, 18, 19)
"""Joints whose unrest decides it."""
UNREST = np.radians(15)
"""Spread of a mover's rotation about its worst axis at which its part is half released; the weight falls with the 8th power."""
USUAL, USUAL_LEAN = np.radians(4), np.radians(3)
"""Prior spreads of joints and lean in people who hold a pose."""
USUAL_WEIGHT = 0.3
"""Weight of the prior spreads against those of the clip."""
LEAN, PITCH, ROLL = np.radians((2, 4)), np.radians(10), np.radians(4)
"""Spreads over clips: of the mean lean to the side and to the front, of the camera's pitch, of its roll."""
LEAST_MEAN_SPREAD = 0.5
"""Smallest spread of a joint's mean rotation over clips, rad: the frames know it better."""


class Stance:
    """The term of one clip; its weight is 0 until `learn` was called."""

    def __init__(self, active: np.ndarray):
        """active: (A,) joints, the pelvis first."""
        self.active = np.asarray(active)
        self.spread = np.full((len(active), 3), np.inf)  # rad
        mean, spread = pose_prior(active)
        mean[0], spread[0] = 0, (LEAN[0], 1, LEAN[1])
        spread[1:] = np.maximum(spread[1:], LEAST_MEAN_SPREAD)
        self.mean = np.concatenate([mean.ravel(), [0, 0]])  # (H,)
        self.mean_spread = np.concatenate([spread.ravel(), [ROLL, PITCH]])  # (H,)

    def residual(self, local: np.ndarray, vector: np.ndarray, stance: np.ndarray) -> np.ndarray:
        """Residuals (T, A, 3) in spreads. local: (T, A, 3, 3) rotations; vector: (T, A, 3) their logarithms; stance: (H,)."""
        return self._deviation(local, vector, stance) / self.spread

    def add(self, system: System, local: np.ndarray, vector: np.ndarray, stance: np.ndarray, first: int) -> None:
        """Adds the term to the normal equations.

        local: (T, A, 3, 3) rotations; vector: (T, A, 3) their logarithms; stance: (H,), whose first shared unknown is `first`.
        """
        if not np.isfinite(self.spread).any():
            return
        residual = self.residual(local, vector, stance)
        slope = rotation.log_derivative(vector)  # (T, A, 3, 3)
        slope[:, 0] = _cross(local[:, 0].swapaxes(1, 2) @ upright(stance)[0])
        slope /= self.spread[:, :, None]
        for i in range(len(self.active)):
            rows, weight = slope[:, i], 1 / self.spread[i]
            block, shared = slice(3 * i, 3 * i + 3), slice(first + 3 * i, first + 3 * i + 3)
            system.band[:, block, block] += rows.swapaxes(1, 2) @ rows
            system.gradient[:, block] += np.einsum("tab,ta->tb", rows, residual[:, i])
            system.arrow[:, block, shared] -= rows.swapaxes(1, 2) * weight
            system.shared[shared, shared] += len(vector) * np.diag(weight**2)
            system.shared_gradient[shared] -= (residual[:, i] * weight).sum(0)
        self._add_upright(system, local, stance, residual[:, 0], slope[:, 0], first)

    def _add_upright(self, system: System, local: np.ndarray, stance: np.ndarray, residual: np.ndarray, rows: np.ndarray,
                     first: int) -> None:
        """Adds the slopes of the lean by the upright. residual: (T, 3) of the lean; rows: (T, 3, 3) by the pelvis' step."""
        weight = 1 / self.spread[0]
        by_up = local[:, 0].swapaxes(1, 2) @ upright(stance)[1] * weight[:, None]  # (T, 3, 2)
        lean, up = slice(first, first + 3), slice(first + len(stance) - 2, first + len(stance))
        across = -(by_up * weight[:, None]).sum(0)  # (3, 2)
        system.arrow[:, :3, up] += rows.swapaxes(1, 2) @ by_up
        system.shared[lean, up] += across
        system.shared[up, lean] += across.T
        system.shared[up, up] += np.einsum("tab,tac->bc", by_up, by_up)
        system.shared_gradient[up] += np.einsum("tab,ta->b", by_up, residual)

    def learn(self, local: np.ndarray, stance: np.ndarray) -> np.ndarray:
        """Learns the spreads from the frames. Returns stance (H,), at the first call the means over the frames.

        local: (T, A, 3, 3) rotations; stance: (H,).
        """
        vector = rotation.log(local)
        if not np.isfinite(self.spread).any():
            up = local[:, 0, :, 1].mean(0)
            stance = np.concatenate([vector.mean(0).ravel(), -up[[0, 2]] / min(up[1], -0.3)])
            stance[:3] = 0
        unrest = np.sqrt(((vector - vector.mean(0)) ** 2).mean(0)).max(1)  # (A,)
        spread = np.sqrt((USUAL_WEIGHT * USUAL**2 + (self._deviation(local, vector, stance) ** 2).mean(0)) / (USUAL_WEIGHT + 1))
        spread[0] = np.sqrt(spread[0] ** 2 + USUAL_WEIGHT * (USUAL_LEAN**2 - USUAL**2) / (USUAL_WEIGHT + 1))
        spread[0, 1] = np.inf
        trunk = self._calm(unrest, TRUNK)
        for joints, calm in ((TRUNK, trunk), *((arm, trunk * self._calm(unrest, arm)) for arm in ARMS)):
            spread[np.isin(self.active, joints)] *= 1 / np.sqrt(calm) if calm > 0.01 else np.inf
        self.spread = spread
        return stance

    def _calm(self, unrest: np.ndarray, joints: tuple[int, ...]) -> float:
        """1 if the movers among the joints rest, 0 if they move. unrest: (A,) rad."""
        worst = unrest[np.isin(self.active, np.intersect1d(joints, MOVERS))].max(initial=0)
        return 1 / (1 + (worst / UNREST) ** 8)

    def _deviation(self, local: np.ndarray, vector: np.ndarray, stance: np.ndarray) -> np.ndarray:
        """Deviations (T, A, 3) rad of the frames from the stance (H,)."""
        away = vector - stance[:-2].reshape(-1, 3)
        away[:, 0] = local[:, 0].swapaxes(1, 2) @ upright(stance)[0] - stance[:3]
        away[:, 0, 1] = 0
        return away


def upright(stance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vector (3,) that points up in the camera frame, and its derivative (3, 2) by its slopes. stance: (H,)."""
    v = np.array([stance[-2], -1, stance[-1]])
    length = np.linalg.norm(v)
    u = v / length
    return u, (np.eye(3) - np.outer(u, u))[:, [0, 2]] / length


def _cross(v: np.ndarray) -> np.ndarray:
    """Matrices (T, 3, 3) of the cross products with v (T, 3)."""
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], 1).reshape(-1, 3, 3)
