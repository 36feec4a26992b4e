"""Frames in which the detector takes left for right, as detectors do of backs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.yaw import yaw
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.swapped_sides import propose_by_faces, propose_swapped
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.state import Fit, to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, sightings_of, turning_person

FRAMES, BACK = 16, np.isin(np.arange(16), range(6, 10))
MADE_UP = np.isin(np.arange(16), (7, 8))
"""Backs that the detector sees as fronts, with a front's depths."""


@pytest.fixture(scope="module")
def truth(body):
    return turning_person(body, FRAMES)


def made_up_fronts(body: Body, truth: BodyParams, face: bool = True) -> Sightings:
    """Sightings of a turn whose face is found where it shows, and two backs that are seen as fronts. face: whether it is at all."""
    valid = (np.abs(yaw(rotation.exp(truth.global_orient.astype(float)))) < np.radians(45)) & face
    seen = replace(sightings_of(body, truth), face={"valid": valid}).exchange_sides(MADE_UP)
    seen.world[MADE_UP, :, 2] *= -1
    return seen


def fit(body: Body, truth: BodyParams, seen: Sightings) -> Fit:
    with threadpool_limits(1, "blas"):
        return fit_clip(body, seen, [], SmplxConfig(height_m=height_of(body, truth), silhouette=0), lambda *a: None)


def test_fronts_that_the_detector_made_up_of_backs_are_exchanged_where_no_face_is_found(body, truth):
    found = fit(body, truth, made_up_fronts(body, truth))
    error = joint_error_mm(body, to_params(body, found.state, np.array([WIDTH / 2, HEIGHT / 2])), truth)
    assert [note.frames for note in found.notes if note.code is Code.SIDES_EXCHANGED] == [[[7, 8]]]
    assert error[MADE_UP].mean() < 60  # their depths are the front's, and do not count


def test_fronts_between_backs_are_named_where_faces_do_not_tell(body, truth):
    found = fit(body, truth, made_up_fronts(body, truth, face=False))
    assert [note.frames for note in found.notes if note.code is Code.TURNED_OVER] == [[[7, 8]]]


def test_a_front_between_backs_that_has_a_face_is_believed(body, truth):
    order = np.arange(FRAMES)
    order[[0, 8]] = 8, 0  # pictures out of order
    other = replace(truth, global_orient=truth.global_orient[order], body_pose=truth.body_pose[order])
    seen = replace(sightings_of(body, other), face={"valid": np.isin(order, (14, 15, 0, 1))})
    assert not propose_by_faces(seen).any()
    assert Code.TURNED_OVER not in [note.code for note in fit(body, truth, seen).notes]


def test_a_face_that_is_missed_or_made_up_in_a_clean_turn_accuses_nobody(body, truth):
    for t, valid in ((1, np.isin(np.arange(FRAMES), (0, 14, 15))), (8, np.isin(np.arange(FRAMES), (0, 1, 8, 14, 15)))):
        seen = replace(sightings_of(body, truth), face={"valid": valid})
        assert not propose_by_faces(seen).any(), t


def test_exchanging_sides_twice_changes_nothing(body, truth):
    seen = sightings_of(body, truth)
    twice = seen.exchange_sides(BACK).exchange_sides(BACK)
    assert np.array_equal(twice.xy, seen.xy) and np.array_equal(twice.world, seen.world, equal_nan=True)


def test_a_right_clip_is_not_accused(body, truth):
    assert not propose_swapped(sightings_of(body, truth)).any()


def test_backs_taken_for_fronts_are_exchanged_and_named(body, truth):
    seen = sightings_of(body, truth).exchange_sides(BACK)
    with threadpool_limits(1, "blas"):
        fit = fit_clip(body, seen, [], SmplxConfig(height_m=height_of(body, truth), silhouette=0), lambda *a: None)
    error = joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), truth)
    assert [(note.code, note.frames) for note in fit.notes] == [(Code.SIDES_EXCHANGED, [[6, 9]])]
    assert error[BACK].mean() < 40


@pytest.mark.parametrize("seed", [0, 3])
def test_of_pictures_in_no_order_none_is_exchanged(body, seed):
    """Of trunk and limbs alone: then the points hardly tell a back from a front, and the exchanged ones jump less."""
    truth, order = turning_person(body, 8), np.random.default_rng(seed).permutation(8)
    shuffled = replace(truth, global_orient=truth.global_orient[order], body_pose=truth.body_pose[order])
    seen = sightings_of(body, shuffled, noise=2.0)
    seen.score[:, [*range(5), *range(17, 133)]] = 0
    assert propose_swapped(seen).any(), "the turn alone accuses some"
    with threadpool_limits(1, "blas"):
        fit = fit_clip(body, seen, [], SmplxConfig(height_m=height_of(body, truth), silhouette=0), lambda *a: None)
    assert Code.SIDES_EXCHANGED not in [note.code for note in fit.notes]
