"""A hand behind the back, and hands that are not detected for other reasons."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from gsac.avatar.frame_files import read_alpha, write_alpha
from gsac.avatar.joints import INDEX
from gsac.avatar.wholebody import INDEX as POINT
from gsac.avatar.wholebody import LEFT_HAND
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.lm import hidden_search
from gsac.stages.smplx.lm.fit import find_followed, fit_clip, fit_points, set_up
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, QUICK, STILL, HiddenArms, Stay, bridge, describe_arms, find_usual
from gsac.stages.smplx.lm.hidden_arms import WRIST as WRIST_ROW
from gsac.stages.smplx.lm.hidden_search import search_hidden
from gsac.stages.smplx.silhouette import read_outline
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, outlines_of, sightings_of, turning_person

FRAMES, HIDDEN, MISREAD = 16, slice(0, 7), slice(0, 11)
FOLLOWED = np.ones(FRAMES, bool)
ELBOW, WRIST = INDEX["left_elbow"], INDEX["left_wrist"]


def hide_left_hand(truth):
    """Swings the left hand behind the back for the first frames, and out again in 0.4 s."""
    pose = truth.body_pose.reshape(FRAMES, 21, 3).copy()
    yaw = np.linspace(-0.5, 1.2, FRAMES)
    turn = Rotation.from_euler("x", np.pi) * Rotation.from_euler("y", yaw[:, None])
    truth.global_orient = turn.as_rotvec().reshape(FRAMES, 3).astype(np.float32)
    share = np.clip((HIDDEN.stop + 4 - np.arange(FRAMES)) / 5, 0, 1)[:, None]
    for joint, goal in ((15, (0.8, 0.3, -1.4)), (17, (0.5, -1.25, 0.0))):
        pose[:, joint] += share * (np.array(goal) - pose[:, joint])
    truth.body_pose = pose.reshape(FRAMES, 63)
    return truth


@pytest.fixture(scope="module")
def fitted(body, tmp_path_factory):
    truth = hide_left_hand(turning_person(body, FRAMES))
    seen = misread_left_arm(sightings_of(body, truth))
    seen.missing = np.zeros((FRAMES, 2), bool)
    seen.missing[HIDDEN, 0] = True
    seen.score[HIDDEN, LEFT_HAND] = 0
    outlines = outlines_of(body, truth, tmp_path_factory.mktemp("alpha"))
    with threadpool_limits(1, "blas"):
        fit = fit_clip(body, seen, outlines, SmplxConfig(height_m=height_of(body, truth)), lambda *a: None)
    return truth, fit, joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), truth)


def test_a_hand_behind_the_back_lies_behind_the_back(fitted):
    _, _, error = fitted
    assert np.median(error[HIDDEN, WRIST]) < 80 and np.median(error[HIDDEN, ELBOW]) < 40


def test_a_hidden_hand_is_named_with_side_and_frames(fitted):
    _, fit, _ = fitted
    (finding,) = describe_arms(fit.arms, np.ones(FRAMES, bool))
    assert (finding.code, finding.frames) == (Code.HAND_HIDDEN, [[0, 6]]) and "left hand" in finding.message


def test_of_frames_that_show_nobody_or_are_not_fitted_no_arm_is_said_to_be_hidden_or_in_doubt():
    arms, fitted = {code: np.zeros((8, 2), bool) for code in (Code.HAND_HIDDEN, Code.ARM_DOUBTFUL)}, np.arange(8) > 2
    arms[Code.HAND_HIDDEN][:3, 0] = arms[Code.ARM_DOUBTFUL][:3] = True
    assert describe_arms(arms, fitted) == []
    arms[Code.ARM_DOUBTFUL][2:6, 1] = True
    (finding,) = describe_arms(arms, fitted)
    assert (finding.code, finding.frames, finding.figure) == (Code.ARM_DOUBTFUL, [[3, 5]], 3) and "right arm" in finding.message


def test_the_sigma_of_a_hidden_arm_tells_how_far_off_it_may_be(fitted):
    _, fit, error = fitted
    for joint in (ELBOW, WRIST):
        assert (error[HIDDEN, joint] < 2e3 * fit.sigma_joints[HIDDEN, joint]).mean() >= 0.9
    assert fit.sigma_joints[HIDDEN, WRIST].min() >= 0.1 > fit.sigma_joints[:, INDEX["right_wrist"]].max()


def test_a_hand_that_the_body_covers_is_not_searched_again(body, tmp_path):
    truth = turning_person(body, 16)
    seen = sightings_of(body, truth)
    missing = np.zeros((16, 2), bool)
    missing[3:7, 0] = missing[9:12, 1] = True  # the far arm of either side view
    problem, state = start_of(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)))
    arms = HiddenArms.of(body, seen.person_height)
    arms.find(problem, state, missing, FOLLOWED)
    assert not arms.stays


def test_a_far_arm_that_may_hang_as_usual_hides_nothing_and_its_made_up_wrist_does_not_count(body, tmp_path):
    truth = turning_person(body, 16)
    seen = sightings_of(body, truth)
    problem, state = start_of(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)))
    state.local[3:7, ARM_JOINTS[0, 1]] = Rotation.from_euler("y", -90, degrees=True).as_matrix()  # held out before the chest
    problem.seen.seconds = 0.3 * np.arange(16)
    missing = np.zeros((16, 2), bool)
    missing[3:7, 0] = True
    arms = HiddenArms.of(body, seen.person_height)
    chain = problem.skeleton.pose(state.local, state.shape)
    assert arms.contradict(problem, state, chain.frame(5), 5, 0) > 0
    arms.find(problem, state, missing, FOLLOWED)
    assert not arms.stays
    assert np.isinf(problem.seen.spread[3:7, WRIST_ROW[0]]).all() and np.isfinite(problem.seen.spread[:, WRIST_ROW[1]]).all()


def test_a_hand_that_would_be_seen_if_its_arm_hung_as_usual_is_hidden_though_nothing_contradicts_the_fit(body, tmp_path):
    truth = hide_left_hand(turning_person(body, FRAMES))
    seen = sightings_of(body, truth)
    problem, state = start_of(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)))
    arms, missing = HiddenArms.of(body, seen.person_height), np.zeros((FRAMES, 2), bool)
    missing[HIDDEN, 0] = True
    state.local[HIDDEN, ARM_JOINTS[0, 1:3]] = Rotation.from_rotvec([[0.8, 0.3, -1.4], [0.5, -1.25, 0]]).as_matrix()
    chain = problem.skeleton.pose(state.local, state.shape)
    assert not any(arms.contradict(problem, state, chain.frame(t), t, 0) for t in range(7))
    arms.find(problem, state, missing, FOLLOWED)
    assert [(stay.side, stay.first, stay.last) for stay in arms.stays] == [(0, 0, 7)]
    alone = HiddenArms.of(body, seen.person_height)
    alone.find(problem, state, missing, ~missing[:, 0])
    assert not alone.stays  # frames that the body does not follow tell of no hand


def test_a_frame_is_not_followed_whose_mask_lies_elsewhere_or_that_shows_nobody(body, tmp_path):
    truth = turning_person(body, FRAMES)
    seen, outlines = sightings_of(body, truth), outlines_of(body, truth, tmp_path)
    problem, state = start_of(body, seen, outlines, SmplxConfig(height_m=height_of(body, truth)))
    assert find_followed(problem, state).all()
    aside = replace(outlines[3], mask=np.roll(outlines[3].mask, outlines[3].mask.shape[1] // 3, 1))
    problem.seen.outlines = [*outlines[:3], aside, *outlines[4:]]
    problem.seen.spread[9] = np.inf
    assert np.flatnonzero(~find_followed(problem, state)).tolist() == [3, 9]


def test_a_hand_rests_on_the_back_also_in_frames_that_show_it_there_and_no_longer(body, tmp_path):
    truth = hide_left_hand(turning_person(body, FRAMES))
    seen = sightings_of(body, truth)
    problem, state = start_of(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)))
    arms, missing = HiddenArms.of(body, seen.person_height), np.zeros((FRAMES, 2), bool)
    missing[:4, 0] = True
    arms.stays = [Stay(0, 0, 4, 0, FRAMES, find_usual(state.local[HIDDEN.stop + 2:][:, ARM_JOINTS[0]]))]
    search_hidden(arms, problem, state, missing)
    (stay,) = arms.stays
    assert stay.on_back and stay.held[0] == 0 and HIDDEN.stop - 1 <= stay.held[1] <= HIDDEN.stop + 2


def test_the_usual_arm_is_a_rotation_that_a_few_gestures_do_not_move():
    vectors = np.full((9, 4, 3), 0.3)
    vectors[:3] = -2.0
    usual = find_usual(Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(9, 4, 3, 3))
    assert usual is not None
    np.testing.assert_allclose(usual, np.tile(Rotation.from_rotvec(vectors[8, 0]).as_matrix(), (4, 1, 1)), atol=1e-9)
    vectors[3:6] = 1.0
    assert find_usual(Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(9, 4, 3, 3)) is None
    assert find_usual(np.zeros((0, 4, 3, 3))) is None


@pytest.mark.parametrize("apart, noticed", [(0.3, True), (0.1, False)])
def test_one_frame_in_plain_view_is_enough_where_frames_are_far_apart(body, tmp_path, apart, noticed):
    truth = hide_left_hand(turning_person(body, FRAMES))
    seen = misread_left_arm(sightings_of(body, truth))
    problem, state = start_of(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)))
    missing = np.zeros((FRAMES, 2), bool)
    missing[4, 0] = True
    problem.seen.seconds = apart * np.arange(FRAMES)
    arms = HiddenArms.of(body, seen.person_height)
    arms.find(problem, state, missing, FOLLOWED)
    assert [(stay.side, stay.first, stay.last) for stay in arms.stays] == ([(0, 4, 5)] if noticed else [])


def test_a_frame_without_a_mask_does_not_break_the_search(body, tmp_path):
    truth = hide_left_hand(turning_person(body, FRAMES))
    seen = misread_left_arm(sightings_of(body, truth))
    outlines = outlines_of(body, truth, tmp_path)
    write_alpha(tmp_path / "nobody.exr", np.zeros((HEIGHT, WIDTH), np.float32))
    outlines[4] = read_outline(tmp_path / "nobody.exr")
    problem, state = start_of(body, seen, outlines, SmplxConfig(height_m=height_of(body, truth)))
    missing = np.zeros((FRAMES, 2), bool)
    missing[2:6, 0] = True
    arms = HiddenArms.of(body, seen.person_height)
    arms.find(problem, state, missing, FOLLOWED)
    assert arms.stays and np.isfinite(search_hidden(arms, problem, state, missing).local).all()


@pytest.mark.parametrize("dearer, factor", [(-1, STILL), (1, QUICK)])
def test_an_arm_whose_hand_is_out_of_sight_rests_unless_another_path_is_cheaper(body, tmp_path, monkeypatch, dearer, factor):
    find = hidden_search.Search.find
    monkeypatch.setattr(hidden_search.Search, "find", lambda *given: replace(find(*given), cost=dearer * given[1].rests))
    truth = hide_left_hand(turning_person(body, FRAMES))
    seen = misread_left_arm(sightings_of(body, truth))
    problem, state = start_of(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)))
    missing = np.zeros((FRAMES, 2), bool)
    missing[HIDDEN, 0] = True
    arms = HiddenArms.of(body, seen.person_height)
    arms.find(problem, state, missing, FOLLOWED)
    search_hidden(arms, problem, state, missing)
    (stay,) = arms.stays
    left, right = (np.isin(problem.active, joints) for joints in ARM_JOINTS)
    assert stay.rests == (factor == STILL) and (stay.resting.start, stay.resting.stop) == (stay.first + 1, stay.last - 1)
    assert (problem.loose[stay.resting, left] == factor).all() and (problem.loose[:, right] == 1).all()
    assert (problem.loose[[stay.first, stay.last - 1, stay.last]][:, left] == QUICK).all()


def misread_left_arm(seen):
    """Networks know hands before the body, and put those behind it there too."""
    for point, nearer in (("left_elbow", 0.2), ("left_wrist", 0.45)):
        seen.world[MISREAD, POINT[point], 2] -= nearer
    return seen


def start_of(body, seen, outlines, config):
    """Problem and state after the fit of the points."""
    detector = Detector.load(seen.detector, body)
    problem, state, _ = set_up(body, seen, outlines, detector, config)
    with threadpool_limits(1, "blas"):
        return problem, fit_points(problem, state, seen, detector, 8)[0]


def test_runs_of_missing_hands_bridge_short_sightings():
    missing = np.zeros(12, bool)
    missing[[1, 2, 5, 9]] = True
    assert bridge(missing) == [(1, 6), (9, 10)]


@pytest.fixture(scope="module")
def without_forearm(body, tmp_path_factory):
    """The start of a person who stands with hanging arms, and of whom the mask lacks the left forearm with its hand."""
    truth = turning_person(body, FRAMES)
    truth.global_orient[:] = (np.pi, 0, 0)
    seen = sightings_of(body, truth)
    folder = tmp_path_factory.mktemp("alpha")
    outlines_of(body, truth, folder)
    outlines = []
    for t, path in enumerate(sorted(folder.glob("*.exr"))):
        alpha = read_alpha(path)
        points = seen.xy[t, [POINT["left_elbow"], POINT["left_wrist"], *range(LEFT_HAND.start, LEFT_HAND.stop)]].astype(np.int32)
        cv2.polylines(alpha, [points[:2]], False, 0, 40)
        cv2.fillConvexPoly(alpha, cv2.convexHull(points[1:]), 0)
        for point in points[1:]:
            cv2.circle(alpha, point.tolist(), 16, 0, -1)
        write_alpha(path, alpha)
        outlines.append(read_outline(path))
    return HiddenArms.of(body, seen.person_height), *start_of(body, seen, outlines, SmplxConfig(height_m=height_of(body, truth)))


@pytest.mark.parametrize("lost, noticed", [(6, True), (4, False)])
def test_a_forearm_beside_the_body_and_outside_the_mask_counts_for_half_a_frame(without_forearm, lost, noticed):
    arms, problem, state = without_forearm
    missing = np.zeros((FRAMES, 2), bool)
    missing[3:3 + lost, 0] = True
    found = HiddenArms(arms.trunk, arms.forearm, arms.height, [])
    found.find(problem, state, missing, FOLLOWED)
    assert [(stay.side, stay.first, stay.last) for stay in found.stays] == ([(0, 3, 3 + lost)] if noticed else [])
    chain = problem.skeleton.pose(state.local, state.shape)
    assert [arms.contradict(problem, state, chain.frame(4), 4, side) for side in (0, 1)] == [0.5, 0.0]
