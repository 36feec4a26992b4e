"""Arms that the pictures contradict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.avatar import rotation
from gsac.avatar.joints import INDEX
from gsac.avatar.wholebody import INDEX as POINT
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.lm.fit import fit_points, set_up
from gsac.stages.smplx.lm.hidden_arms import HiddenArms, Stay, describe_arms, widen_arm
from support.turning_person import height_of, outlines_of, sightings_of, turning_person

FRAMES = 16


@pytest.fixture(scope="module")
def fitted(body, tmp_path_factory):
    """Arms, problem and state of a person who turns with hanging arms, fitted by the points."""
    truth = turning_person(body, FRAMES)
    seen = sightings_of(body, truth)
    problem, state, _ = set_up(body, seen, outlines_of(body, truth, tmp_path_factory.mktemp("alpha")),
                            Detector.load(seen.detector, body), SmplxConfig(height_m=height_of(body, truth)))
    with threadpool_limits(1, "blas"):
        return HiddenArms.of(body, seen.person_height), problem, fit_points(problem, state, seen,
                                                                            Detector.load(seen.detector, body), 8)[0]


def test_arms_that_hang_are_not_doubted_where_the_body_covers_a_hand(fitted):
    missing = np.zeros((FRAMES, 2), bool)
    missing[4:6, 0] = missing[10:12, 1] = True
    assert not fitted[0].find_doubtful(*fitted[1:], missing).any()


def test_a_hand_that_is_not_detected_for_most_of_a_turn_is_doubted(fitted):
    missing = np.zeros((FRAMES, 2), bool)
    missing[3:12, 1] = True
    found = fitted[0].find_doubtful(*fitted[1:], missing)
    assert np.flatnonzero(found[:, 1]).tolist() == list(range(3, 12)) and not found[:, 0].any()
    (finding,) = describe_arms(Code.ARM_DOUBTFUL, found)
    assert (finding.code, finding.frames) == (Code.ARM_DOUBTFUL, [[3, 11]]) and "right arm" in finding.message


def test_a_hand_that_the_detector_hardly_ever_finds_is_no_doubt(fitted):
    missing = np.ones((FRAMES, 2), bool)
    missing[::3] = False
    assert not fitted[0].find_doubtful(*fitted[1:], missing).any()


def test_a_hand_that_is_said_to_be_hidden_is_not_said_to_be_doubtful_too(fitted):
    arms, problem, state = fitted
    missing = np.zeros((FRAMES, 2), bool)
    missing[3:12, 1] = True
    told = HiddenArms(arms.trunk, arms.forearm, arms.height, [Stay(1, 3, 12, 0, FRAMES)])
    assert not told.find_doubtful(problem, state, missing).any()


def test_a_wrist_seen_elsewhere_for_some_frames_makes_its_arm_doubtful(fitted):
    arms, problem, state = fitted
    kept = problem.seen.xy.copy()
    problem.seen.xy[2:7, POINT["left_wrist"]] += 0.2 * arms.height
    found = arms.find_doubtful(problem, state, None)
    problem.seen.xy[:] = kept
    assert np.flatnonzero(found[:, 0]).tolist() == [2, 3, 4, 5, 6] and not found[:, 1].any()


def test_an_arm_on_end_beside_its_points_is_doubtful_and_in_single_frames_is_not(fitted):
    arms, problem, state = fitted
    xy, spread, elbow = problem.seen.xy, problem.seen.spread, POINT["left_elbow"]
    problem.seen.xy = problem.project(state, problem.locate_points(problem.skeleton.pose(state.local, state.shape), state))
    problem.seen.spread = spread.copy()
    problem.seen.spread[:, elbow] = 2.0
    problem.seen.xy[[2, 3, 4, 8, 11], elbow] += (6.4, 0)
    found = arms.find_doubtful(problem, state, None)
    problem.seen.xy, problem.seen.spread = xy, spread
    assert np.flatnonzero(found[:, 0]).tolist() == [2, 3, 4] and not found[:, 1].any()


@pytest.mark.parametrize("bend, told, doubted", [(1.5, False, True), (1.5, True, False), (0.1, False, False)])
def test_a_hand_that_moved_while_nothing_told_where_it_was_is_doubted(fitted, bend, told, doubted):
    arms, problem, state = fitted
    missing = np.zeros((FRAMES, 2), bool)
    missing[5:7, 0] = True
    moved = replace(state, local=state.local.copy())
    moved.local[6:, INDEX["left_elbow"]] = rotation.exp(np.array([0, -bend, 0])) @ state.local[6:, INDEX["left_elbow"]]
    xy, spread = problem.seen.xy, problem.seen.spread
    problem.seen.xy = problem.project(moved, problem.locate_points(problem.skeleton.pose(moved.local, moved.shape), moved))
    problem.seen.spread = spread.copy()
    problem.seen.spread[5:7, POINT["left_wrist"]] = 0.01 * arms.height if told else np.inf
    found = arms.find_doubtful(problem, moved, missing)
    problem.seen.xy, problem.seen.spread = xy, spread
    assert np.flatnonzero(found[:, 0]).tolist() == ([5, 6] if doubted else []) and not found[:, 1].any()


def test_the_sigma_of_a_doubtful_arm_is_raised_in_its_frames_alone():
    sigma, doubtful = np.full((4, 55), 0.02), np.zeros((4, 2), bool)
    doubtful[1, 0] = True
    widen_arm(sigma, 0, doubtful[:, [0]])
    assert sigma[1, INDEX["left_wrist"]] > 0.1 and sigma[1, INDEX["left_elbow"]] > 0.05
    assert (sigma[[0, 2, 3]] == 0.02).all() and sigma[1, INDEX["right_wrist"]] == 0.02
