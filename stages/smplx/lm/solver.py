"""Levenberg-Marquardt over all frames. The normal equations are a block band (frames and their temporal neighbours) with an arrow
(shared unknowns).

T frames, n unknowns a frame, s shared unknowns. Temporal terms reach two frames ahead, so the band is 3 n wide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular

AnyState = TypeVar("AnyState")


@dataclass
class System:
    """Normal equations J'J x = -J'r of rows J and residuals r."""

    band: np.ndarray  # (T, n, 3 n): block row t against frames t, t + 1, t + 2
    arrow: np.ndarray  # (T, n, s)
    shared: np.ndarray  # (s, s)
    gradient: np.ndarray  # (T, n)
    shared_gradient: np.ndarray  # (s,)

    @classmethod
    def zeros(cls, frames: int, size: int, shared: int) -> System:
        """No equations yet; size: n, shared: s."""
        return cls(np.zeros((frames, size, 3 * size)), np.zeros((frames, size, shared)), np.zeros((shared, shared)),
                   np.zeros((frames, size)), np.zeros(shared))

    def add(self, frames: slice, jacobian: np.ndarray, residual: np.ndarray) -> None:
        """Adds rows: jacobian (F, R, n + s'), residual (F, R) of F frames, by the first s' shared unknowns."""
        n, shared = self.gradient.shape[1], slice(jacobian.shape[2] - self.gradient.shape[1])
        across = jacobian.swapaxes(1, 2)
        square, slope = across @ jacobian, (across @ residual[..., None])[..., 0]
        self.band[frames, :, :n] += square[:, :n, :n]
        self.arrow[frames, :, shared] += square[:, :n, n:]
        self.shared[shared, shared] += square[:, n:, n:].sum(0)
        self.gradient[frames] += slope[:, :n]
        self.shared_gradient[shared] += slope[:, n:].sum(0)

    def add_shared(self, jacobian: np.ndarray, residual: np.ndarray) -> None:
        """Adds rows on the shared unknowns alone: jacobian (R, s), residual (R,)."""
        self.shared += jacobian.T @ jacobian
        self.shared_gradient += jacobian.T @ residual

    def solve(self, damping: float, frozen: np.ndarray, frozen_shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step (T, n) and shared step (s,). frozen: (n,) bool and frozen_shared: (s,) bool, unknowns that stay.

        Raises LinAlgError where the damped system is not positive definite.
        """
        t, n = self.gradient.shape
        band = self.band.copy()
        diagonal = np.arange(n)
        band[:, diagonal, diagonal] += damping * band[:, diagonal, diagonal] + 1e-9
        band[:, diagonal[frozen], diagonal[frozen]] += FROZEN
        right = np.concatenate([-self.gradient[:, :, None], self.arrow], 2)
        solved = solve_band(band, right).reshape(t * n, -1)
        arrow = self.arrow.reshape(t * n, -1)
        schur = self.shared - arrow.T @ solved[:, 1:]
        schur[np.diag_indices_from(schur)] += damping * np.diag(self.shared) + 1e-9 + FROZEN * frozen_shared
        shared = np.linalg.solve(schur, -self.shared_gradient - arrow.T @ solved[:, 0])
        return (solved[:, 0] - solved[:, 1:] @ shared).reshape(t, n), shared


FROZEN = 1e12
"""Added to the diagonal at unknowns that stay."""
DAMPING = 1e-5
"""At the first step, as a share of each unknown's own curvature. Shape and the hips' place lie in valleys a thousandth as steep as
their surroundings: with more damping the fit stops on the way."""
TOLERANCE = 1e-3
"""Relative decrease of the cost below which the solver stops."""


def solve_band(band: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solves the symmetric band system by block Cholesky over pairs of frames, which makes it block tridiagonal.

    band: (T, n, 3 n) upper block rows; right: (T, n, k). Returns (T, n, k).
    """
    t, n = band.shape[:2]
    if t % 2:
        band = np.concatenate([band, np.zeros((1, n, 3 * n))])
        band[-1, :, :n] = np.eye(n)
        right = np.concatenate([right, np.zeros((1, *right.shape[1:]))])
    first, second = band[0::2], band[1::2]
    pairs, m = len(first), 2 * n
    diagonal = np.zeros((pairs, m, m))
    diagonal[:, :n, :n], diagonal[:, :n, n:], diagonal[:, n:, n:] = first[..., :n], first[..., n:m], second[..., :n]
    diagonal[:, n:, :n] = first[..., n:m].swapaxes(1, 2)
    ahead = np.zeros((pairs, m, m))
    ahead[:, :n, :n], ahead[:, n:, :n], ahead[:, n:, n:] = first[..., m:], second[..., n:m], second[..., m:]
    solved = right.reshape(pairs, m, -1).copy()
    factors, couplings = [], []
    for i in range(pairs):
        if i:
            diagonal[i] -= couplings[-1].T @ couplings[-1]
            solved[i] -= couplings[-1].T @ solved[i - 1]
        factor = cholesky(diagonal[i], lower=True, check_finite=False)
        factors.append(factor)
        both = solve_triangular(factor, np.concatenate([ahead[i], solved[i]], 1), lower=True, check_finite=False)
        couplings.append(both[:, :m])
        solved[i] = both[:, m:]
    for i in reversed(range(pairs)):
        if i + 1 < pairs:
            solved[i] -= couplings[i] @ solved[i + 1]
        solved[i] = solve_triangular(factors[i], solved[i], lower=True, trans=1, check_finite=False)
    return solved.reshape(-1, n, right.shape[2])[:t]


def robust(residual: np.ndarray, limit: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Geman and McClure's robust loss (1987), by iterated reweighting.

    residual: (...) in spreads; limit: scalar or (...), the residual in spreads beyond which the loss flattens. Returns the cost
    (...) and the square root of the weight (...).
    """
    square = residual**2
    shrink = 1 / (1 + square / limit**2)
    return square * shrink, shrink


def levenberg_marquardt(state: AnyState, linearise: Callable[[AnyState], System], cost: Callable[[AnyState], float],
                        move: Callable[[AnyState, np.ndarray, np.ndarray], AnyState], frozen: np.ndarray,
                        frozen_shared: np.ndarray, iterations: int) -> tuple[AnyState, int]:
    """Minimises `cost(state)`. Returns state and number of steps.

    move: the state after a step (T, n) and a shared step (s,); frozen: (n,) bool and frozen_shared: (s,) bool, unknowns that stay.
    Stops after `iterations` accepted or refused steps, or when a step lowers the cost by less than `TOLERANCE` of it.
    """
    damping, lowest, steps, system = DAMPING, cost(state), 0, None
    for _ in range(iterations):
        system = system or linearise(state)
        try:
            step, shared = system.solve(damping, frozen, frozen_shared)
        except LinAlgError:
            damping = max(damping, 1e-6) * 10
            continue
        trial = move(state, step, shared)
        value = cost(trial)
        steps += 1
        if np.isfinite(value) and value < lowest:
            gain = 1 - value / lowest
            state, damping, lowest = trial, max(damping / 5, 1e-7), value
            if gain < TOLERANCE:
                break
            system = None
        else:
            damping *= 8
            if damping > 1e6:
                break
    return state, steps
