"""Levenberg-Marquardt over all frames: a block band (frames and their temporal neighbours) with an arrow (shared unknowns).

T frames, n unknowns a frame, s shared unknowns. Temporal terms reach two frames ahead, so the band is 3 n wide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded


@dataclass
class System:
    """Normal equations J'J x = -J'r and their cost."""

    band: np.ndarray  # (T, n, 3 n): block row t against frames t, t + 1, t + 2
    arrow: np.ndarray  # (T, n, s)
    shared: np.ndarray  # (s, s)
    gradient: np.ndarray  # (T, n)
    shared_gradient: np.ndarray  # (s,)
    cost: float = 0.0

    @classmethod
    def zeros(cls, frames: int, size: int, shared: int) -> System:
        return cls(np.zeros((frames, size, 3 * size)), np.zeros((frames, size, shared)), np.zeros((shared, shared)),
                   np.zeros((frames, size)), np.zeros(shared))

    def add(self, t: int, jacobian: np.ndarray, residual: np.ndarray, shared: np.ndarray | None = None) -> None:
        """Rows (R, n), residuals (R,) and shared columns (R, s) of one frame."""
        n = self.gradient.shape[1]
        self.band[t, :, :n] += jacobian.T @ jacobian
        self.gradient[t] += jacobian.T @ residual
        if shared is not None:
            self.arrow[t] += jacobian.T @ shared
            self.shared += shared.T @ shared
            self.shared_gradient += shared.T @ residual

    def add_shared(self, jacobian: np.ndarray, residual: np.ndarray) -> None:
        """Rows (R, s) on the shared unknowns alone."""
        self.shared += jacobian.T @ jacobian
        self.shared_gradient += jacobian.T @ residual

    def solve(self, damping: float, frozen: np.ndarray, frozen_shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step (T, n) and shared step (s,); frozen (n,) and frozen_shared (s,) mark unknowns that stay."""
        t, n = self.gradient.shape
        band = self.band.copy()
        diagonal = np.arange(n)
        band[:, diagonal, diagonal] += damping * band[:, diagonal, diagonal] + 1e-9
        band[:, diagonal[frozen], diagonal[frozen]] += 1e12
        lower = np.zeros((3 * n, t, n))
        for i in range(n):
            lower[: 3 * n - i, :, i] = band[:, i, i:].T
        lower = lower.reshape(3 * n, t * n)
        factor = cholesky_banded(lower, lower=True, overwrite_ab=True, check_finite=False)
        right = np.concatenate([-self.gradient.reshape(-1, 1), self.arrow.reshape(t * n, -1)], 1)
        solved = cho_solve_banded((factor, True), right, check_finite=False)
        arrow = self.arrow.reshape(t * n, -1)
        schur = self.shared - arrow.T @ solved[:, 1:]
        schur[np.diag_indices_from(schur)] += damping * np.diag(self.shared) + 1e-9
        schur[np.diag_indices_from(schur)] += 1e12 * frozen_shared
        shared = np.linalg.solve(schur, -self.shared_gradient - arrow.T @ solved[:, 0])
        return (solved[:, 0] - solved[:, 1:] @ shared).reshape(t, n), shared


@dataclass
class Trace:
    """How a solve went."""

    costs: list[float]
    steps: int = 0


def levenberg_marquardt(state, linearise: Callable, cost: Callable, move: Callable, frozen: np.ndarray,
                        frozen_shared: np.ndarray, iterations: int, tolerance: float = 1e-3) -> tuple[object, Trace]:
    """Minimises `cost(state)`; `linearise(state)` gives a System, `move(state, step, shared)` a new state.

    Stops after `iterations` accepted or refused steps, or when a step lowers the cost by less than `tolerance` of it.
    """
    damping, trace = 1e-3, Trace([cost(state)])
    system = linearise(state)
    for _ in range(iterations):
        try:
            step, shared = system.solve(damping, frozen, frozen_shared)
        except (LinAlgError, np.linalg.LinAlgError):
            damping = max(damping, 1e-6) * 10
            continue
        trial = move(state, step, shared)
        value = cost(trial)
        trace.steps += 1
        if np.isfinite(value) and value < trace.costs[-1]:
            gain = 1 - value / trace.costs[-1]
            state, damping = trial, max(damping / 5, 1e-7)
            trace.costs.append(value)
            if gain < tolerance:
                break
            system = linearise(state)
        else:
            damping *= 8
            if damping > 1e6:
                break
    return state, trace
