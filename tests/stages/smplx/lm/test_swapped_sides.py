"""Frames in which the detector takes left for right, as detectors do of backs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.swapped_sides import propose_swapped
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, sightings_of, turning_person

FRAMES, BACK = 16, np.isin(np.arange(16), range(6, 10))


@pytest.fixture(scope="module")
def truth(body):
    return turning_person(body, FRAMES)


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
