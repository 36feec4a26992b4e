"""A wrong focal length is given; a right one is given that no main lens has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm import doubted_focal
from gsac.stages.smplx.lm.doubted_focal import fit_with_doubt
from support.turning_person import FOCAL, height_of, sightings_of, turning_person


def fit_given(body, focal, factor):
    """Focal length, px, that a fit believes of a clip taken with `focal`, px, and given `factor` times that."""
    truth = turning_person(body, 8)
    truth.focal = np.array([focal, focal], np.float32)
    truth.transl = truth.transl * np.array([1, 1, focal / FOCAL], np.float32)
    sightings = replace(sightings_of(body, truth, noise=1.0), focal_px=focal * factor)
    config = SmplxConfig(height_m=height_of(body, truth), silhouette=0.0, rounds=1)
    with threadpool_limits(1, "blas"):
        return np.exp(fit_with_doubt(body, sightings, [], config, lambda *a: None).state.log_focal)


@pytest.mark.parametrize("factor", [0.3, 4.0])
def test_a_focal_length_that_the_points_contradict_gives_way_to_the_one_they_show(body, factor):
    assert fit_given(body, FOCAL, factor) == pytest.approx(FOCAL, rel=0.15)


@pytest.mark.parametrize("focal", [2.5 * FOCAL, 0.5 * FOCAL])
def test_a_right_focal_length_wins_whatever_the_lens(body, focal):
    assert fit_given(body, focal, 1.0) == pytest.approx(focal, rel=0.02)


def test_a_main_lens_and_a_focal_length_not_given_cost_one_fit(body, monkeypatch):
    fits = []
    monkeypatch.setattr(doubted_focal, "fit_clip", lambda *given: fits.append(given) or given)
    seen = sightings_of(body, turning_person(body, 2))
    for focal in (None, 0.8 * 640, 640.0):
        fit_with_doubt(body, replace(seen, focal_px=focal), [], SmplxConfig(), lambda *a: None)
    assert len(fits) == 3
