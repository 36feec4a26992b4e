"""The pose correctives that an avatar's file carries."""

from __future__ import annotations

import numpy as np

from gsac.avatar.correctives import DIRECTIONS, move_rest
from gsac.avatar.sparse_correctives import LEFT_OUT, thin_out
from support.official_body import strong_poses


def test_what_thinning_leaves_out_moves_no_vertex_farther_than_promised(official_body):
    rng = np.random.default_rng(3)
    dense = official_body.posedirs + rng.normal(0, 3e-8, official_body.posedirs.shape).astype(np.float32)
    thin = thin_out(dense)
    assert 0.01 < len(thin.joint) / (54 * len(dense)) < 0.5 and thin.start[-1] == len(thin.joint) and thin.joint.min() > 0
    worst = max(np.linalg.norm(thin.move_rest(p) - move_rest(dense, p), axis=1).max() for p in strong_poses(20))
    assert 0 < worst < LEFT_OUT
    whole = thin_out(rng.normal(0, 1, (5, 3, DIRECTIONS)).astype(np.float32))
    assert len(whole.joint) == 5 * 54
