"""Arms that the pictures contradict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from gsac.avatar import rotation
from gsac.avatar.joints import INDEX
from gsac.avatar.wholebody import INDEX as POINT
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.lm.doubtful_arms import find_contradicted, find_untold, settle_doubtful, with_stays
from gsac.stages.smplx.lm.fit import fit_points, set_up
from gsac.stages.smplx.lm.hidden_arms import HiddenArms, Stay, describe_arms, widen_arm
from gsac.stages.smplx.lm.hidden_search import ON_BELLY, hiding_pose
from gsac.stages.smplx.state import State
from support.turning_person import height_of, outlines_of, sightings_of, turning_person

FRAMES, ON_BACK = 16, range(5, 11)
NONE = np.zeros((FRAMES, 2), bool)
"""Hands that were not detected."""


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
    assert not find_untold(*fitted, missing).any()


def test_a_hand_that_is_not_detected_for_most_of_a_turn_is_doubted(fitted):
    missing = np.zeros((FRAMES, 2), bool)
    missing[3:12, 1] = True
    found = find_untold(*fitted, missing)
    assert np.flatnonzero(found[:, 1]).tolist() == list(range(3, 12)) and not found[:, 0].any()
    (finding,) = describe_arms({Code.ARM_DOUBTFUL: found}, np.ones(len(found), bool))
    assert (finding.code, finding.frames) == (Code.ARM_DOUBTFUL, [[3, 11]]) and "right arm" in finding.message


def test_a_hand_that_the_detector_hardly_ever_finds_is_no_doubt(fitted):
    missing = np.ones((FRAMES, 2), bool)
    missing[::3] = False
    assert not find_untold(*fitted, missing).any()


def test_a_hand_that_is_said_to_be_hidden_is_not_said_to_be_doubtful_too(fitted):
    arms, problem, state = fitted
    missing = np.zeros((FRAMES, 2), bool)
    missing[3:12, 1] = True
    told = HiddenArms(arms.trunk, arms.forearm, arms.height, [Stay(1, 3, 12, 0, FRAMES)])
    assert not find_untold(told, problem, state, missing).any()


def test_a_stay_that_was_searched_from_a_mirrored_arm_is_searched_again_with_it(fitted):
    arms = HiddenArms(fitted[0].trunk, fitted[0].forearm, fitted[0].height, [Stay(1, 8, 11, 4, 13), Stay(0, 8, 11, 4, 13)])
    mirrored = np.zeros((FRAMES, 2), bool)
    mirrored[[0, 5, 6], 1] = mirrored[[1, 2], 0] = True
    again = with_stays(arms, mirrored)
    assert np.flatnonzero(again[:, 1]).tolist() == [5, 6, 7, 8, 9, 10]  # with the frame between
    assert not again[:, 0].any()


def test_a_wrist_seen_elsewhere_for_some_frames_makes_its_arm_doubtful(fitted):
    arms, problem, state = fitted
    kept = problem.seen.xy.copy()
    problem.seen.xy[2:7, POINT["left_wrist"]] += 0.2 * arms.height
    found = find_contradicted(arms, problem, state, NONE)
    problem.seen.xy[:] = kept
    assert np.flatnonzero(found[:, 0]).tolist() == [2, 3, 4, 5, 6] and not found[:, 1].any()


def test_an_arm_beside_its_points_is_doubtful_on_end_or_far_off_and_a_little_in_single_frames_is_not(fitted):
    arms, problem, state = fitted
    xy, spread, elbow = problem.seen.xy, problem.seen.spread, POINT["left_elbow"]
    problem.seen.xy = problem.project(state, problem.locate_points(problem.skeleton.pose(state.local, state.shape), state))
    problem.seen.spread = spread.copy()
    problem.seen.spread[:, elbow] = 2.0
    problem.seen.xy[[2, 3, 4, 8, 11], elbow] += (6.4, 0)
    found = find_contradicted(arms, problem, state, NONE)
    assert np.flatnonzero(found[:, 0]).tolist() == [2, 3, 4] and not found[:, 1].any()
    problem.seen.xy[8, elbow] += (3.2, 0)
    far = find_contradicted(arms, problem, state, NONE)
    problem.seen.xy, problem.seen.spread = xy, spread
    assert np.flatnonzero(far[:, 0]).tolist() == [2, 3, 4, 8] and not far[:, 1].any()


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
    found = find_untold(arms, problem, moved, missing)
    problem.seen.xy, problem.seen.spread = xy, spread
    assert np.flatnonzero(found[:, 0]).tolist() == ([5, 6] if doubted else []) and not found[:, 1].any()


@pytest.fixture(scope="module")
def hand_on_back(body, tmp_path_factory):
    """Arms, problem and true state of a person seen from behind whose left hand lies on the back for the middle frames."""
    truth = turning_person(body, FRAMES)
    pose = truth.body_pose.reshape(FRAMES, 21, 3).copy()
    turn = Rotation.from_euler("x", np.pi) * Rotation.from_euler("y", np.pi + np.linspace(-0.4, 0.4, FRAMES)[:, None])
    truth.global_orient = turn.as_rotvec().reshape(FRAMES, 3).astype(np.float32)
    for joint, bent in ((15, (0.8, 0.3, -1.4)), (17, (0.5, -1.05, 0.0))):
        pose[ON_BACK, joint] = bent
    truth.body_pose = pose.reshape(FRAMES, 63)
    seen = sightings_of(body, truth)
    problem, state, _ = set_up(body, seen, outlines_of(body, truth, tmp_path_factory.mktemp("alpha")),
                               Detector.load(seen.detector, body), SmplxConfig(height_m=height_of(body, truth)))
    local = rotation.exp(truth.pose.reshape(FRAMES, 55, 3).astype(float))
    return HiddenArms.of(body, seen.person_height), problem, replace(state, local=local, transl=truth.transl.astype(float),
                                                                     betas=truth.betas.astype(float))


def put_inside_trunk(truth: State) -> State:
    """The state with the hand of the frames on the back inside the trunk."""
    state = replace(truth, local=truth.local.copy())
    for joint, turn in zip((16, 18), rotation.exp(hiding_pose(0, ON_BELLY)), strict=True):
        state.local[ON_BACK, joint] = turn
    return state


def test_where_pictures_do_not_tell_poses_apart_an_arm_is_doubted_and_stays(hand_on_back):
    arms, problem, truth = hand_on_back
    state = put_inside_trunk(truth)
    settled, doubtful = settle_doubtful(arms, problem, state, None, NONE, movable=False)
    assert doubtful[ON_BACK, 0].all() and settled is state


def test_a_hand_that_is_seen_on_the_back_and_fitted_inside_the_trunk_is_moved_to_the_back(hand_on_back):
    arms, problem, truth = hand_on_back
    state = put_inside_trunk(truth)
    with threadpool_limits(1, "blas"):
        settled, doubtful = settle_doubtful(arms, problem, state, None, NONE, movable=True)
    wrist = [problem.skeleton.pose(s.local, s.shape).place[ON_BACK, INDEX["left_wrist"]] for s in (truth, state, settled)]
    before, after = (np.linalg.norm(other - wrist[0], axis=-1) for other in wrist[1:])
    assert doubtful[ON_BACK, 0].all() and not doubtful[:, 1].any()
    assert before.min() > 0.1 and np.median(after) < 0.08 and after.max() < 0.5 * before.min()


def test_an_arm_that_was_found_to_rest_on_the_back_is_doubted_but_not_moved_again(hand_on_back):
    arms, problem, truth = hand_on_back
    state = put_inside_trunk(truth)
    told = HiddenArms(arms.trunk, arms.forearm, arms.height, [Stay(0, 0, 1, 0, FRAMES, on_back=True)])
    settled, doubtful = settle_doubtful(told, problem, state, None, NONE, movable=True)
    assert doubtful[ON_BACK, 0].all() and np.array_equal(settled.local, state.local)


@pytest.mark.parametrize("covered", [True, False])
def test_an_arm_beside_its_points_in_one_frame_is_doubted_only_where_the_body_leaves_a_part_of_the_mask(hand_on_back, covered):
    arms, problem, truth = hand_on_back
    state, frame, elbow = replace(truth, local=truth.local.copy()), 13, POINT["left_elbow"]
    if not covered:
        state.local[frame, INDEX["left_shoulder"]] = rotation.exp(np.array([0, 0, -1.5]))
    xy, spread = problem.seen.xy, problem.seen.spread
    problem.seen.xy = problem.project(state, problem.locate_points(problem.skeleton.pose(state.local, state.shape), state))
    problem.seen.spread = spread.copy()
    problem.seen.spread[frame, elbow] = 2.0
    problem.seen.xy[frame, elbow] += (6.4, 0)
    found = find_contradicted(arms, problem, state, NONE)
    problem.seen.xy, problem.seen.spread = xy, spread
    assert bool(found[frame, 0]) is not covered and not np.delete(found, frame, 0).any()


def test_an_arm_as_the_pictures_show_it_keeps_still(hand_on_back):
    state, doubtful = settle_doubtful(*hand_on_back, None, NONE, movable=True)
    assert not doubtful.any() and np.array_equal(state.local, hand_on_back[2].local)


def test_the_sigma_of_a_doubtful_arm_is_raised_in_its_frames_alone():
    sigma, doubtful = np.full((4, 55), 0.02), np.zeros((4, 2), bool)
    doubtful[1, 0] = True
    widen_arm(sigma, 0, doubtful[:, [0]])
    assert sigma[1, INDEX["left_wrist"]] > 0.1 and sigma[1, INDEX["left_elbow"]] > 0.05
    assert (sigma[[0, 2, 3]] == 0.02).all() and sigma[1, INDEX["right_wrist"]] == 0.02
