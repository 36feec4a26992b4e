"""A camera that shakes moves the person before it and not their limbs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from gsac.stages.smplx import prior
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm import fit
from gsac.stages.smplx.lm.shake import transl_acceleration
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, sightings_of, turning_person


def shaken(seen: Sightings, px: float) -> Sightings:
    return replace(seen, xy=seen.xy + np.random.default_rng(3).normal(0, px, (len(seen.xy), 1, 2)))


def test_a_shaken_camera_is_not_laid_into_the_pose(body, monkeypatch):
    person, error = turning_person(body, 8), []
    seen, config = shaken(sightings_of(body, person), 20.0), SmplxConfig(silhouette=0, height_m=height_of(body, person), rounds=1)
    for stiff in (False, True):
        if stiff:
            monkeypatch.setattr(fit, "transl_acceleration", lambda sightings: np.full(3, prior.TRANSL_ACCELERATION))
        with threadpool_limits(1, "blas"):
            found = fit.fit_clip(body, seen, [], config, lambda *a: None)
        error.append(joint_error_mm(body, to_params(body, found.state, np.array([WIDTH / 2, HEIGHT / 2])), person).mean())
    assert error[0] < 20 and error[0] < 0.6 * error[1]


def test_the_prior_of_a_person_before_a_still_camera_stays_and_depth_keeps_it_always(body):
    seen = sightings_of(body, turning_person(body, 12), noise=2.0)
    np.testing.assert_array_equal(transl_acceleration(seen), prior.TRANSL_ACCELERATION)
    spread = transl_acceleration(shaken(seen, 20.0))
    assert (spread[:2] > 4 * prior.TRANSL_ACCELERATION).all() and spread[2] == prior.TRANSL_ACCELERATION
    np.testing.assert_array_equal(transl_acceleration(replace(shaken(seen, 20.0), seconds=None)), prior.TRANSL_ACCELERATION)
