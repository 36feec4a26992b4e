"""Pictures at a wrong time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from gsac.stages.findings import Code
from gsac.stages.severity import Severity
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.turn_jumps import find_jumps
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, sightings_of, turning_person

FRAMES = 16
ORDER = np.arange(FRAMES)
ORDER[[3, 7, 12]] = 12, 3, 7


def test_an_even_turn_has_no_jump_however_few_its_frames():
    for frames in (8, 20, 60):
        turns = Rotation.from_euler("y", np.linspace(0, 360, frames)[:, None], degrees=True).as_matrix()
        assert not find_jumps(turns).any()


def test_pictures_out_of_order_are_each_fitted_alone_and_named(body):
    truth = turning_person(body, FRAMES)
    truth = replace(truth, global_orient=truth.global_orient[ORDER], body_pose=truth.body_pose[ORDER])
    with threadpool_limits(1, "blas"):
        fit = fit_clip(body, sightings_of(body, truth), [], SmplxConfig(height_m=height_of(body, truth), silhouette=0),
                       lambda *a: None)
    error = joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), truth)
    (note,) = [note for note in fit.notes if note.code is Code.TURN_JUMPS]
    named = {t for first, last in note.frames for t in range(first, last + 1)}
    assert {3, 7, 12} <= named and Severity.NEWS is note.code.value.severity
    assert error.mean() < 40
