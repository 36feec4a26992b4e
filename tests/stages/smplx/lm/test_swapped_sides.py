"""Frames in which the detector takes left for right, as detectors do of backs."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.swapped_sides import is_swapped, propose_swapped
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


def test_points_that_contradict_an_exchange_outweigh_any_jumps():
    assert not is_swapped(saved=-700.0, smoother=9, frames=9) and is_swapped(saved=290.0, smoother=4, frames=4)
