"""The published co-registration: its schedule, and that it fits."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.initial import estimate_start
from gsac.stages.smplx.paper.fit import BATCH, PASSES, Pass, descend, fit_clip
from gsac.stages.smplx.paper.loss import Objective
from support.turning_person import FOCAL, HEIGHT, WIDTH, facing_person, head_of, sightings_of

pytestmark = pytest.mark.slow

torch.set_num_threads(1)  # as fit_clip does

SHORT = (Pass(60, 0.1, (30, 50), 20, True), Pass(20, 0.01, (10,), 0, True), Pass(10, 0.01, (5,), 0, False))


@pytest.fixture(scope="module")
def fitted(body):
    told = []
    sightings = sightings_of(body, facing_person(body), seconds=False)
    fit = fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: told.append(done), SHORT)
    return sightings, fit, told


def test_the_schedule_is_the_published_one():
    passes = [(p.steps, p.rate, p.warm_up, p.shared) for p in PASSES]
    assert passes == [(500, 0.1, 100, True), (250, 0.01, 0, True), (250, 0.01, 0, False)]
    assert PASSES[0].decays == (100, 250, 400) and BATCH == 64


def test_a_short_descent_lowers_the_reprojection(body, fitted):
    sightings, fit, told = fitted
    start = estimate_start(body, sightings, FOCAL, np.array([WIDTH / 2, HEIGHT / 2]))
    objective = Objective(body, sightings, start, np.array([WIDTH / 2, HEIGHT / 2]))
    before = objective.pixels(start.local, start.transl, start.betas, np.zeros((55, 3))) - sightings.xy[:, objective.known]
    assert np.median(fit.reprojection) < 0.5 * np.median(np.linalg.norm(before, axis=-1))
    assert told[-1] == (90, 90, "steps") and fit.steps == 90
    assert np.isfinite(fit.sigma_joints).all()


def test_pelvis_and_hips_never_move_and_all_other_joints_may(fitted):
    offset = fitted[1].joint_offset
    assert not offset[:3].any()
    assert (np.abs(offset[3:22]).max(1) > 0).all() and np.abs(offset).max() < 0.1


def test_betas_and_face_offsets_draw_the_head_towards_the_one_that_face_found(body):
    betas = np.append(np.random.default_rng(5).normal(0, 1.5, body.num_figure), np.zeros(len(body.clothes)))
    sightings = sightings_of(body, facing_person(body), seconds=False, face=head_of(body, betas))
    center = np.array([WIDTH / 2, HEIGHT / 2])
    start = estimate_start(body, sightings, FOCAL, center)
    objective = Objective(body, sightings, start, center)
    unknowns = objective.unknowns(start.transl)
    losses = []
    for sweep in (Pass(2, 0.003, (), 2, True), Pass(30, 0.003, (15, 25), 0, True)):
        descend(objective, unknowns, slice(0, 4), sweep, True, lambda done: None)
        losses.append(float(objective.head.loss(unknowns.betas.detach(), unknowns.face_offset.detach())))
    assert losses[1] < 0.3 * losses[0], losses


def test_without_a_head_mesh_the_fit_says_that_face_terms_are_off(body, fitted):
    assert any("face terms" in note.message for note in fitted[1].notes)
    sightings = sightings_of(body, facing_person(body), seconds=False, face=head_of(body, np.zeros(body.num_betas)))
    tiny = (Pass(2, 0.1, (1,), 1, True),)
    fit = fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: None, tiny)
    assert not any("face terms" in note.message for note in fit.notes)


@pytest.mark.parametrize("frames", [1, 65])
def test_one_photo_and_more_frames_than_a_batch_are_fitted(body, frames):
    told = []
    sightings = sightings_of(body, facing_person(body, frames), seconds=frames > 1)
    sightings.score[0, 20:] = 0
    if frames > 1:
        sightings.score[30], sightings.xy[30] = 0, np.nan
    tiny = (Pass(8, 0.1, (4,), 4, True), Pass(2, 0.01, (1,), 0, False))
    fit = fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: told.append(done), tiny)
    steps = 10 * -(-frames // BATCH)
    assert told[-1] == (steps, steps, "steps")
    assert all(np.isfinite(a).all() for a in (fit.state.local, fit.state.transl, fit.state.betas, fit.sigma_joints))
    turned = fit.state.local[:, 0] @ np.swapaxes(fit.state.local[:, 0], -1, -2)
    np.testing.assert_allclose(turned, np.tile(np.eye(3), (frames, 1, 1)), atol=1e-5)
