"""The priors of a turning clip: their derivatives, and who is held."""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.stages.smplx.lm.solver import System
from gsac.stages.smplx.lm.stance import Stance
from gsac.stages.smplx.prior import BODY_JOINTS
from support.turning_person import turning_person


def test_derivatives_of_the_stance_agree_with_finite_differences(body):
    """Gradient and, as these residuals have no outliers and hardly bend, the normal equations too."""
    truth = turning_person(body, 4)
    local = rotation.exp(truth.pose[:, :22].astype(float) + np.random.default_rng(2).normal(0, 0.05, (4, 22, 3)))
    stance = Stance(BODY_JOINTS)
    value = stance.learn(local, np.zeros(68)) + np.random.default_rng(3).normal(0, 0.05, 68)
    system = System.zeros(4, 69, 17 + 68)
    stance.add(system, local, rotation.log(local), value, 17)

    def residual(step: np.ndarray, shared: np.ndarray) -> np.ndarray:
        moved = local @ rotation.exp(step)
        return stance.residual(moved, rotation.log(moved), value + shared).ravel()

    steps = np.concatenate([np.eye(4 * 66).reshape(-1, 4, 22, 3), np.zeros((68, 4, 22, 3))])
    shared = np.concatenate([np.zeros((4 * 66, 68)), np.eye(68)])
    columns = [(residual(1e-5 * a, 1e-5 * b) - residual(-1e-5 * a, -1e-5 * b)) / 2e-5 for a, b in zip(steps, shared, strict=True)]
    jacobian = np.stack(columns, 1)
    frames, clip = np.split(jacobian.T @ residual(0 * steps[0], 0 * shared[0]), [4 * 66])
    assert np.allclose(system.gradient[:, :66].ravel(), frames, atol=1e-4)
    assert np.allclose(system.shared_gradient[17:], clip, atol=1e-4)
    normal = jacobian.T @ jacobian
    assert np.allclose(system.shared[17:, 17:], normal[4 * 66:, 4 * 66:], atol=1e-3)
    for t in range(4):
        own = slice(66 * t, 66 * t + 66)
        assert np.allclose(system.band[t, :66, :66], normal[own, own], atol=1e-3)
        assert np.allclose(system.arrow[t, :66, 17:], normal[own, 4 * 66:], atol=1e-3)


def test_who_turns_is_held_and_who_moves_is_let_go(body):
    turning = rotation.exp(turning_person(body, 20).pose[:, :22].astype(float))
    squatting = rotation.exp(np.zeros((20, 22, 3)) + np.eye(22)[[1, 2, 4, 5]].sum(0)[:, None] * [1, 0, 0]
                             * np.linspace(0, 1.6, 20)[:, None, None])
    waving = turning.copy()
    waving[:, 16] = rotation.exp(np.linspace(-1, 1, 20)[:, None] * [0.0, 0, 1])
    stance = Stance(BODY_JOINTS)
    finite = {}
    for name, local in (("turning", turning), ("squatting", squatting), ("waving", waving)):
        stance.learn(local, np.zeros(68))
        finite[name] = np.isfinite(stance.spread).any(1)
    assert finite["turning"].all() and not finite["squatting"].any()
    assert not finite["waving"][[13, 16, 18, 20]].any() and finite["waving"][[1, 4, 14, 17]].all()
