"""The ground's terms against finite differences, and which feet they hold."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.stages.smplx.jacobians import Skeleton, place_points
from gsac.stages.smplx.lm import ground as module
from gsac.stages.smplx.lm.ground import Ground, rate_rest
from gsac.stages.smplx.lm.solver import System
from gsac.stages.smplx.prior import BODY_JOINTS

FRAMES, STANCE = 4, 68


def standing(body: Body, seed: int = 0):
    """Rotations (T, 55, 3, 3), shape, transl (T, 3), stance and level of somebody who stands, a little off."""
    rng = np.random.default_rng(seed)
    local = np.tile(np.eye(3), (FRAMES, 55, 1, 1))
    local[:, 0] = np.diag([1.0, -1, -1])
    local[:, :22] = local[:, :22] @ rotation.exp(rng.normal(0, 0.02, (FRAMES, 22, 3)))
    stance = np.zeros(STANCE)
    stance[-2:] = 0.02, -0.1
    return local, rng.normal(0, 0.3, body.num_betas), np.array([0, 0, 2.5]) + rng.normal(0, 0.01, (FRAMES, 3)), stance


def on_ground(body: Body, limits: float, monkeypatch):
    monkeypatch.setattr(module, "LIFTED", limits)
    monkeypatch.setattr(module, "SUNK", 2 * limits)
    monkeypatch.setattr(module, "SLIPPED", limits)
    ground, skeleton = Ground(body, 0.7), Skeleton(body, BODY_JOINTS)
    local, shape, transl, stance = standing(body)
    ground.rest = np.random.default_rng(1).uniform(0, 30, (FRAMES - 1, 8))
    level = ground.estimate_level(skeleton.pose(local, shape), shape, transl, stance) - 0.004
    return ground, skeleton, local, shape, transl, stance, level


def moved(skeleton, local, shape, transl, stance, level, step, shared):
    """The state after a step (T, 69) and a shared step (1 + B + 68 + 1,)."""
    turned = local.copy()
    turned[:, :22] = turned[:, :22] @ rotation.exp(step[:, :66].reshape(FRAMES, 22, 3))
    b = 1 + len(shape)
    shape = shape + shared[1:b]
    return skeleton.pose(turned, shape), shape, transl + step[:, 66:], stance + shared[b:-1], level + shared[-1:]


def test_derivatives_of_the_ground_agree_with_finite_differences(body, monkeypatch):
    """Without outliers: gradient and normal equations."""
    ground, skeleton, *state = on_ground(body, np.inf, monkeypatch)
    size, count = 1 + body.num_betas + STANCE + 1, 69 * FRAMES
    system = System.zeros(FRAMES, 69, size)
    ground.add(system, skeleton, skeleton.pose(state[0], state[1]), *state[1:])

    def residual(x):
        chain, shape, transl, stance, level = moved(skeleton, *state, x[:count].reshape(FRAMES, 69), x[count:])
        place = place_points(chain, ground.pairs, shape) + transl[:, None]
        return np.concatenate([ground._height_residual(place, stance, level).ravel(), ground._slip_residual(place).ravel()])

    jacobian = np.stack([(residual(1e-5 * e) - residual(-1e-5 * e)) / 2e-5 for e in np.eye(count + size)], 1)
    normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual(np.zeros(count + size))
    close = dict(rtol=1e-4, atol=1e-6 * np.abs(normal).max())
    assert np.allclose(system.gradient.ravel(), gradient[:count], rtol=1e-4, atol=1e-6 * np.abs(gradient).max())
    assert np.allclose(system.shared_gradient, gradient[count:], rtol=1e-4, atol=1e-6 * np.abs(gradient).max())
    assert np.allclose(system.shared, normal[count:, count:], **close)
    for t in range(FRAMES):
        own, ahead = slice(69 * t, 69 * t + 69), slice(69 * t + 69, min(69 * t + 138, count))
        assert np.allclose(system.band[t, :, :69], normal[own, own], **close)
        assert np.allclose(system.band[t, :, 69: 69 + ahead.stop - ahead.start], normal[own, ahead], **close)
        assert np.allclose(system.arrow[t], normal[own, count:], **close)


def test_the_slope_is_the_costs_where_feet_are_let_go(body, monkeypatch):
    ground, skeleton, *state = on_ground(body, 2.0, monkeypatch)
    system = System.zeros(FRAMES, 69, 1 + body.num_betas + STANCE + 1)
    ground.add(system, skeleton, skeleton.pose(state[0], state[1]), *state[1:])
    rng = np.random.default_rng(2)
    for _ in range(4):
        step, shared = rng.normal(0, 1, (FRAMES, 69)), rng.normal(0, 1, system.shared_gradient.shape)
        up, down = (ground.cost(*moved(skeleton, *state, h * step, h * shared)) for h in (1e-6, -1e-6))
        assert (up - down) / 2e-6 == pytest.approx(2 * ((system.gradient * step).sum() + system.shared_gradient @ shared), rel=1e-3)


def test_lifted_soles_are_let_go_sooner_than_sunk_ones(body):
    ground, skeleton = Ground(body), Skeleton(body, BODY_JOINTS)
    local, shape, transl, stance = standing(body)
    chain = skeleton.pose(local, shape)
    heights = (place_points(chain, ground.pairs, shape) + transl[:, None]) @ module.upright(stance)[0]

    def pull(level):
        return ground.cost(chain, shape, transl, stance, np.array([level]))

    high, low = heights.max() + 0.3, heights.min() - 0.3
    assert pull(high) > 3 * pull(low)
    assert pull(low) < module.LIFTED**2 * heights.size


def test_soles_are_held_flat(body):
    """A foot that tips by four degrees about its own length, its middle staying on the ground, is turned back."""
    ground, skeleton, level = Ground(body), Skeleton(body, BODY_JOINTS), np.zeros(1)
    local, _, _, stance = standing(body)
    stance[:] = 0
    local[:] = np.eye(3)
    local[:, 0] = np.diag([1.0, -1, -1])
    ankle, shape = body.joint_names.index("left_ankle"), np.zeros(body.num_betas)
    slopes = []
    for degrees in (-4, 0, 4):
        local[:, ankle] = rotation.exp(np.radians([0, 0, degrees]))
        chain = skeleton.pose(local, shape)
        transl = -(place_points(chain, ground.pairs, shape)[:, :4].mean(1) @ module.upright(stance)[0])[:, None] * [0, -1, 0]
        system = System.zeros(FRAMES, 69, 1 + len(shape) + STANCE + 1)
        ground.add(system, skeleton, chain, shape, transl, stance, level)
        slopes.append(system.gradient[:, 3 * ankle + 2])
    left, flat, right = np.array(slopes)
    assert (left < -10).all() and (right > 10).all()
    assert (np.abs(flat) < 0.3 * right).all()


def test_feet_that_stand_rest_and_feet_that_step_do_not():
    seconds, still = np.arange(20) / 10, np.zeros((20, 2, 2))
    still += np.random.default_rng(0).normal(0, 0.0005, still.shape)
    stepping = still + np.linspace(0, 0.4, 20)[:, None, None]
    pivoting = still.copy()
    pivoting[:, 1, 0] += np.linspace(0, 0.4, 20)  # the heel stays, the toes go round
    seen = np.ones((20, 2), bool)
    assert rate_rest(still, seen, seconds).min() > 0.8
    assert rate_rest(stepping, seen, seconds).max() < 0.05
    assert rate_rest(pivoting, seen, seconds).max() < 0.05
    assert rate_rest(still, seen & False, seconds).max() == 0
