"""Cost and normal equations against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.camera import Camera
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.jacobians import make_pairs, place_points
from gsac.stages.smplx.lm import problem as module
from gsac.stages.smplx.lm.observations import observe
from gsac.stages.smplx.lm.person_offsets import PersonOffsets
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.prior import BODY_JOINTS
from gsac.stages.smplx.sightings import BODY_POINTS, HIPS
from gsac.stages.smplx.silhouette import sample_outline
from gsac.stages.smplx.state import State, to_params
from support.turning_person import FOCAL, HEIGHT, WIDTH, outlines_of, sightings_of, turning_person


def test_derivatives_agree_with_finite_differences(body, tmp_path):
    truth = turning_person(body, 3)
    outlines = outlines_of(body, truth, tmp_path)
    seen = observe(sightings_of(body, truth, 2.0), Detector.load("", body), BODY_POINTS,
                        np.array([WIDTH / 2, HEIGHT / 2]), (FOCAL, 0.1), SmplxConfig(height_m=1.8), outlines)
    detector = Detector.load("mediapipe", body)
    person_offsets = PersonOffsets.of(body, detector.own, 0.01)
    moves = np.concatenate([detector.slopes(body), person_offsets.points], 2)[BODY_POINTS]
    pairs = make_pairs(body, body.keypoint_matrix[BODY_POINTS], None, moves)
    rng = np.random.default_rng(0)
    state = State(rotation.exp(truth.pose.astype(float) + rng.normal(0, 0.05, truth.pose.shape)),
                  truth.transl.astype(float) + 0.02, np.append(rng.normal(0, 0.3, body.num_figure), np.zeros(len(body.clothes))),
                  float(np.log(FOCAL)), np.zeros(0), np.zeros(len(person_offsets.spread)))
    problem = Problem(body, pairs, HIPS, seen, BODY_JOINTS, 1.0, person_offsets)
    camera = Camera((FOCAL, FOCAL), (WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT)
    chain = problem.skeleton.pose(state.local, state.shape)
    surface = make_pairs(body, body.keypoint_matrix[BODY_POINTS])
    x = place_points(chain, surface, state.shape)[0] + state.transl[0]
    vertices, _ = body.posed(to_params(body, state, problem.seen.center), [0])
    assert np.allclose(x, body.keypoints(vertices)[0][BODY_POINTS], atol=2e-3)
    state.betas[body.num_figure:] = rng.normal(0, 1, len(body.clothes))
    assert np.allclose(place_points(problem.skeleton.pose(state.local, state.shape), surface, state.shape)[0] + state.transl[0], x,
                       atol=1e-3)
    state.own[:] = rng.normal(0, 1, len(state.own)) * person_offsets.spread
    for t, outline in enumerate(outlines):
        vertices, _ = body.posed(to_params(body, state, problem.seen.center), [t])
        problem.outline_pairs[t] = sample_outline(body, vertices[0], camera, outline, t)[0]
    check_gradient(problem, state, rng, 1e-5, 2e-3)
    problem.outline_weight = 1.0
    # the distance field is sampled to 1/32 pixel, so its slope shows only over longer steps
    check_gradient(problem, state, rng, 3e-3, 0.08)


def check_gradient(problem: Problem, state: State, rng, h: float, tolerance: float) -> None:
    """Half the cost's slope along random directions is the system's gradient (exact where no point is an outlier)."""
    robust = module.robust
    module.robust = lambda residual, limit: (residual**2, np.ones_like(residual))
    try:
        system = problem.linearise(state)
        for _ in range(4):
            step = rng.normal(0, 1, (len(state.local), problem.size))
            shared = rng.normal(0, 1, 1 + len(state.shape) + len(state.stance) + len(state.level)) * 0.3
            shared[1 + len(state.betas): 1 + len(state.shape)] *= 0.03  # mostly metres
            slope = (problem.cost(problem.move(state, h * step, h * shared))
                     - problem.cost(problem.move(state, -h * step, -h * shared))) / (2 * h)
            expected = 2 * ((system.gradient * step).sum() + system.shared_gradient @ shared)
            assert slope == pytest.approx(expected, rel=tolerance)
    finally:
        module.robust = robust
