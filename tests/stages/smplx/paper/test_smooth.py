"""Smoothing keeps motion and takes out jitter."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.stages.smplx.paper.smooth import smooth_linear, smooth_rotations

pytestmark = pytest.mark.slow


def test_smoothing_keeps_a_steady_turn_and_takes_out_shaking():
    yaw = np.linspace(0, 2 * np.pi, 40)
    steady = rotation.exp(np.stack([0 * yaw, yaw, 0 * yaw], 1))[:, None]
    np.testing.assert_allclose(smooth_rotations(steady)[5:-5], steady[5:-5], atol=1e-3)
    shaken = steady @ rotation.exp(np.random.default_rng(4).normal(0, 0.05, (40, 1, 3)))
    back = np.swapaxes(steady, -1, -2)
    off = [np.linalg.norm(rotation.log(back @ r), axis=-1).mean() for r in (shaken, smooth_rotations(shaken))]
    assert off[1] < 0.7 * off[0]
    assert smooth_linear(np.ones((5, 3))).shape == (5, 3)
