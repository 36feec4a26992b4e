"""A camera that shakes moves the person before it and not their limbs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.stages.smplx import prior
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.shake import transl_acceleration
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, sightings_of, turning_person


def shaken(seen: Sightings, px: float) -> Sightings:
    return replace(seen, xy=seen.xy + np.random.default_rng(3).normal(0, px, (len(seen.xy), 1, 2)))


def test_a_shaken_camera_costs_the_pose_little(body):
    person = turning_person(body, 12)
    steady = sightings_of(body, person)
    error = []
    for seen in (steady, shaken(steady, 20.0)):
        fit = fit_clip(body, seen, [], SmplxConfig(silhouette=0, height_m=height_of(body, person)), lambda *a: None)
        error.append(joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), person).mean())
    assert error[1] < 1.3 * error[0] + 1


def test_the_prior_of_a_person_before_a_still_camera_stays_and_depth_keeps_it_always(body):
    seen = sightings_of(body, turning_person(body, 12), noise=2.0)
    np.testing.assert_array_equal(transl_acceleration(seen), prior.TRANSL_ACCELERATION)
    spread = transl_acceleration(shaken(seen, 20.0))
    assert (spread[:2] > 4 * prior.TRANSL_ACCELERATION).all() and spread[2] == prior.TRANSL_ACCELERATION
    np.testing.assert_array_equal(transl_acceleration(replace(shaken(seen, 20.0), seconds=None)), prior.TRANSL_ACCELERATION)
