"""The series that stand for the CPU's solves of the displaced surface."""

import numpy as np
from scipy.sparse import csr_matrix, diags

from gsac.avatar.body import Body
from gsac.avatar.cuda.smoothing import smoothing_series
from gsac.stages.train.gaussians.cloth_offsets import SMOOTHNESS, Offsets


def test_the_series_are_the_smoothing_once_and_twice_over():
    from gsac.avatar.cuda.adjacency import vertex_neighbours

    body = Body.load()
    count, solve = len(body.v_template), Offsets(body).solve
    found = smoothing_series(body.faces, count, SMOOTHNESS)
    start, near = vertex_neighbours(np.asarray(body.faces), count)
    laplacian = diags(np.diff(start).astype(float)) - csr_matrix((np.ones(len(near)), near, start), (count, count))
    rng = np.random.default_rng(0)
    bump = np.exp(-np.linalg.norm(body.v_template - body.v_template[5000], axis=1) / 0.03)
    for b in (rng.normal(size=count), bump, np.ones(count)):
        before, now = np.zeros(count), b
        sums = now[:, None] * found.factors[0]
        for k, factor in enumerate(found.factors[1:]):
            turned = (now + SMOOTHNESS * (laplacian @ now) - found.middle * now) / found.half
            before, now = now, turned * (2 if k else 1) - before
            sums += now[:, None] * factor
        for ours, exact in zip(sums.T, (solve(b), solve(solve(b))), strict=True):
            assert np.linalg.norm(ours - exact) < 0.02 * np.linalg.norm(exact)
