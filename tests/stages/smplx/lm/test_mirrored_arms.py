"""Arms that one picture leaves open, and the turn decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from gsac.avatar import rotation
from gsac.avatar.joints import INDEX
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.lm.doubtful_arms import settle_doubtful
from gsac.stages.smplx.lm.fit import set_up
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, HiddenArms
from gsac.stages.smplx.lm.mirrored_arms import find_mirrored, list_arms, turn_arm, weigh
from support.turning_person import height_of, outlines_of, sightings_of, turning_person

FRAMES, MIRRORED = 16, np.isin(np.arange(16), range(9, 13))
NONE = np.zeros((FRAMES, 2), bool)
"""Hands that were not detected."""


@pytest.fixture(scope="module", params=[0, 1], ids=["left", "right"])
def on_hip(request, body, tmp_path_factory):
    """Side, arms, problem and true state of a person who turns with one hand held beside the hip."""
    side, truth = request.param, turning_person(body, FRAMES)
    pose = truth.body_pose.reshape(FRAMES, 21, 3).copy()
    for joint, bent in ((15, (0.0, -0.3, -0.9)), (17, (0.0, -1.4, 0.0))):
        pose[:, joint + side] = bent if side == 0 else (bent[0], -bent[1], -bent[2])
    truth.body_pose = pose.reshape(FRAMES, 63)
    seen = sightings_of(body, truth)
    seen.world[:, :, 2] = np.nan  # depths tell nothing
    problem, state, _ = set_up(body, seen, outlines_of(body, truth, tmp_path_factory.mktemp("alpha")),
                               Detector.load(seen.detector, body), SmplxConfig(height_m=height_of(body, truth)))
    local = rotation.exp(truth.pose.reshape(FRAMES, 55, 3).astype(float))
    return side, HiddenArms.of(body, seen.person_height), problem, replace(state, local=local, transl=truth.transl.astype(float),
                                                                           betas=truth.betas.astype(float))


def mirror(problem, state, side):
    """The state whose arm is mirrored in some frames."""
    chain, out = problem.skeleton.pose(state.local, state.shape), replace(state, local=state.local.copy())
    places = list_arms(chain, state, side)[:, 3]
    for t in np.flatnonzero(MIRRORED):
        out.local[t, ARM_JOINTS[side, 1:3]] = turn_arm(chain, t, side, *np.diff(places[t], axis=0))
    return out


def place_wrist(problem, state, side):
    return problem.skeleton.pose(state.local, state.shape).place[:, ARM_JOINTS[side, 3]]


def test_the_four_arms_of_a_picture_share_pixels_and_lengths(on_hip):
    side, _, problem, truth = on_hip
    chain = problem.skeleton.pose(truth.local, truth.shape)
    places = list_arms(chain, truth, side)
    pixels, lengths = problem.project(truth, places[:, :, 1:]), np.linalg.norm(np.diff(places, axis=2), axis=-1)
    assert np.abs(lengths - lengths[:, :1]).max() < 1e-9
    assert np.median(np.linalg.norm(pixels - pixels[:, :1], axis=-1)) < 1e-6
    assert np.linalg.norm(places[:, 1:, 2] - places[:, :1, 2], axis=-1).max() > 0.3


def test_rotations_of_an_arm_point_where_they_should(on_hip):
    side, _, problem, truth = on_hip
    chain = problem.skeleton.pose(truth.local, truth.shape)
    places, local = list_arms(chain, truth, side)[:, 0], truth.local.copy()
    local[:, ARM_JOINTS[side, 1:3]] = [turn_arm(chain, t, side, *np.diff(own, axis=0)) for t, own in enumerate(places)]
    off = place_wrist(problem, replace(truth, local=local), side) - place_wrist(problem, truth, side)
    assert np.linalg.norm(off, axis=-1).max() < 0.06  # rest bones lie only roughly along the axis


def test_an_arm_that_is_mirrored_along_the_view_for_some_frames_is_doubted_and_set_right(on_hip):
    side, arms, problem, truth = on_hip
    state = mirror(problem, truth, side)
    with threadpool_limits(1, "blas"):
        settled, doubtful = settle_doubtful(arms, problem, state, None, NONE, movable=True)
    before, after = (np.linalg.norm(place_wrist(problem, own, side) - place_wrist(problem, truth, side), axis=-1)[MIRRORED]
                     for own in (state, settled))
    assert before.max() > 0.25 and np.flatnonzero(doubtful[:, side]).tolist() == np.flatnonzero(MIRRORED).tolist()
    assert after.max() < 0.08


def test_an_arm_that_keeps_still_is_no_doubt_however_the_body_turns(on_hip):
    _, arms, problem, truth = on_hip
    assert not find_mirrored(arms, problem, truth, NONE)[0].any()


def test_arms_of_who_does_not_turn_are_no_doubt_however_they_move(on_hip):
    side, arms, problem, truth = on_hip
    state = replace(truth, local=truth.local.copy())
    state.local[:, 0] = truth.local[0, 0]
    assert not find_mirrored(arms, problem, mirror(problem, state, side), NONE)[0].any()


def test_a_quick_gesture_is_no_doubt(on_hip):
    side, arms, problem, truth = on_hip
    state = replace(truth, local=truth.local.copy())
    state.local[8:, INDEX[("left_elbow", "right_elbow")[side]]] = Rotation.from_euler("y", -0.2 if side == 0 else 0.2).as_matrix()
    assert not find_mirrored(arms, problem, state, NONE)[0].any()


def test_a_hand_that_the_detector_hardly_ever_finds_does_not_make_its_arm_hide(on_hip):
    side, arms, problem, truth = on_hip
    chain, frames = problem.skeleton.pose(truth.local, truth.shape), np.arange(FRAMES)
    missing = np.ones(FRAMES, bool)
    missing[::3] = False
    places = list_arms(chain, truth, side)
    never, once = (weigh(arms, problem, truth, chain, own, places, side, frames) for own in (missing, frames == 1))
    assert not never[missing].any() and once[1].any()
