"""A fit that begins from poses that the user brought."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.avatar import rotation
from gsac.avatar.pose_files.read import Start
from gsac.stages.contract import BadInput
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.initial import estimate_start
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.start.begin import begin
from gsac.stages.smplx.start.fit import take_as_fit
from gsac.stages.smplx.state import to_params
from support.turning_person import FOCAL, HEIGHT, WIDTH, facing_person, joint_error_mm, sightings_of

CENTER = np.array([WIDTH / 2, HEIGHT / 2])
FEW_STEPS = SmplxConfig(rounds=1, iterations=4, silhouette=0.0, contact=0.0)


def hard_person(body, frames=5):
    """Arms up and crossed, one knee high: far from trunk and hanging arms."""
    params = facing_person(body, frames)
    pose = params.pose.astype(float)
    pose[:, 16], pose[:, 17] = [0.2, -0.5, 1.2], [0.2, 0.9, -0.9]
    pose[:, 18], pose[:, 19] = [0, -1.9, 0], [0, 2.0, 0]
    pose[:, 1], pose[:, 4] = [-1.5, 0, 0], [1.9, 0, 0]
    return type(params).from_pose(pose, params.transl, params.betas, params.expression, FOCAL, (WIDTH / 2, HEIGHT / 2),
                                  model=body.digest)


def start_of(params) -> Start:
    return Start(rotation.exp(params.pose.astype(float)), np.full((params.frames, 3), np.nan))


def seen(body, params, start):
    """Without the detector's depth, so that a start decides."""
    sightings = sightings_of(body, params, noise=1.0)
    sightings.start = start
    return sightings


def test_a_brought_start_is_far_nearer_to_a_hard_pose_than_the_closed_form(body):
    params = hard_person(body)
    sightings = seen(body, params, start_of(params))
    state, said = begin(body, sightings, FOCAL, CENTER)
    near, far = (joint_error_mm(body, to_params(body, s, CENTER), params).mean()
                 for s in (state, estimate_start(body, sightings, FOCAL, CENTER)))
    assert near < 0.3 * far and not said
    assert np.abs(state.transl - params.transl).max() < 0.25


def test_a_frame_that_the_file_lacks_is_interpolated_and_one_that_it_turns_away_begins_as_ever(body):
    params = hard_person(body)
    start = start_of(params)
    truth = start.rotations.copy()
    start.rotations[1] = np.nan
    start.rotations[3, 0] = np.diag([1.0, -1, -1]) @ start.rotations[3, 0]  # y up, as in a graphics camera
    sightings = seen(body, params, start)
    state, said = begin(body, sightings, FOCAL, CENTER)
    np.testing.assert_allclose(state.local[1], truth[1], atol=0.03)
    np.testing.assert_allclose(state.local[3], estimate_start(body, sightings, FOCAL, CENTER).local[3])
    assert {f.code: f.frames for f in said} == {Code.START_INTERPOLATED: [[1, 1]], Code.START_DOUBTED: [[3, 3]]}


def test_what_no_frame_has_stays_as_in_the_closed_form(body):
    params = hard_person(body)
    start = start_of(params)
    start.rotations[:, 22:] = np.nan
    state, _ = begin(body, seen(body, params, start), FOCAL, CENTER)
    np.testing.assert_array_equal(state.local[:, 22:], np.tile(np.eye(3), (params.frames, 33, 1, 1)))


def test_the_fit_of_a_hard_pose_gains_by_a_start(body):
    params = hard_person(body, 3)
    errors = []
    for start in (start_of(params), None):
        sightings = seen(body, params, start)
        sightings.world[:] = np.nan
        with threadpool_limits(1, "blas"):
            fit = fit_clip(body, sightings, [], FEW_STEPS, lambda *done: None)
        errors.append(joint_error_mm(body, to_params(body, fit.state, CENTER), params).mean())
    assert errors[0] < 0.5 * errors[1], errors


def test_brought_poses_are_the_result_where_the_user_says_so(body):
    params = hard_person(body)
    start = start_of(params)
    start.betas, start.transl[:] = params.betas, params.transl
    fit = take_as_fit(body, seen(body, params, start), [], SmplxConfig(method="brought", start="poses"), lambda *done: None)
    found = to_params(body, fit.state, CENTER)
    assert joint_error_mm(body, found, params).max() < 0.1
    np.testing.assert_allclose(found.transl, params.transl, atol=1e-5)
    assert np.median(fit.reprojection) < 3 and np.isfinite(fit.sigma_joints).all()


def test_a_brought_place_behind_the_camera_or_at_no_end_is_solved_from_the_points(body):
    params = hard_person(body)
    start = start_of(params)
    start.betas, start.transl[:] = params.betas, params.transl
    start.transl[1], start.transl[3] = -params.transl[1], np.inf
    fit = take_as_fit(body, seen(body, params, start), [], SmplxConfig(method="brought", start="poses"), lambda *done: None)
    np.testing.assert_allclose(fit.state.transl[[1, 3]], params.transl[[1, 3]], atol=0.1)
    assert fit.reprojection.max() < 6


def test_a_result_to_be_brought_needs_a_name():
    with pytest.raises(BadInput, match="smplx.start names no poses"):
        SmplxConfig(method="brought").check()
    assert SmplxConfig(start="poses").models() == ("poses",)
