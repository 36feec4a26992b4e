"""Arms that rest in one pose, or two, while a person turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.joints import INDEX
from gsac.stages.smplx.lm.arm_paths import ArmPaths, measure_turns
from gsac.stages.smplx.lm.doubtful_arms import settle_doubtful
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, Stay, isolate_arm
from gsac.stages.smplx.lm.hidden_search import hiding_pose
from gsac.stages.smplx.lm.resting_arms import NOT_HERE, find_rest, rest_arms
from support.bent_arm import HAIR, distances, person_with, with_left_arm

FRAMES, THERE = 12, range(4, 12)
NONE, LEFT = np.zeros((FRAMES, 2), bool), np.tile([True, False], (FRAMES, 1))
TURN = np.linspace(-0.8, 0.8, FRAMES)


@pytest.fixture(scope="module")
def hand_in_hair(body, tmp_path_factory):
    return person_with(body, tmp_path_factory.mktemp("hair"), HAIR, TURN, range(FRAMES))


@pytest.fixture(scope="module")
def hand_to_hair(body, tmp_path_factory):
    return person_with(body, tmp_path_factory.mktemp("to_hair"), HAIR, TURN, THERE)


@pytest.fixture(autouse=True)
def as_before(hand_in_hair, hand_to_hair):
    """Gives the problems back the spreads of motion and pose that a search changes."""
    problems = [problem for _, problem, _ in (hand_in_hair, hand_to_hair)]
    kept = [(problem.loose.copy(), problem.spread.copy()) for problem in problems]
    yield
    for problem, (loose, spread) in zip(problems, kept, strict=True):
        problem.loose[:], problem.spread[:] = loose, spread


def hang(state):
    """The state with the left arm hanging."""
    pose = state.local[0, ARM_JOINTS[0, 1:]].copy()
    pose[:2] = rotation.exp(np.radians([[0, 0, -60.0], [0, -10, 0]]))
    return with_left_arm(state, pose)


def test_an_arm_that_hangs_in_the_fit_rests_in_the_hair_where_all_frames_show_it_there(hand_in_hair):
    arms, problem, truth = hand_in_hair
    start = hang(truth)
    state, rested = rest_arms(arms, problem, start, LEFT, NONE)
    before, after = (distances(problem, truth, local, "left_wrist") for local in (start.local, state.local))
    assert before.min() > 0.5 and after.max() < 0.1
    assert rested[:, 0].all() and not rested[:, 1].any()
    pose = state.local[:, ARM_JOINTS[0, 1:]]
    assert measure_turns(pose[:-1, :2], pose[1:, :2]).max() < 0.2


def test_an_arm_that_goes_to_the_hair_hangs_before_and_goes_as_quickly_as_a_gesture(hand_to_hair):
    arms, problem, truth = hand_to_hair
    loose, arm, going = problem.loose.copy(), np.isin(problem.active, ARM_JOINTS[0]), slice(THERE[0] - 1, THERE[0] + 1)
    state, rested = rest_arms(arms, problem, with_left_arm(truth, truth.local[0, ARM_JOINTS[0, 1:]]), LEFT, NONE)
    assert distances(problem, truth, state.local, "left_wrist").max() < 0.12
    assert rested[THERE, 0].all() and (problem.loose > loose)[going, arm].all()


def test_an_arm_as_the_pictures_show_it_stays(hand_to_hair):
    arms, problem, truth = hand_to_hair
    loose, spread = problem.loose.copy(), problem.spread.copy()
    state, rested = rest_arms(arms, problem, truth, ~NONE, NONE)
    assert np.array_equal(state.local, truth.local) and not rested.any()
    assert np.array_equal(problem.loose, loose) and np.array_equal(problem.spread, spread)


def test_an_arm_that_rests_is_held_and_not_moved_again(hand_in_hair):
    arms, problem, truth = hand_in_hair
    loose = problem.loose.copy()
    state, rested = rest_arms(arms, problem, hang(truth), LEFT, NONE)
    arm = np.isin(problem.active, ARM_JOINTS[0])
    assert (problem.loose[:, arm] < loose[:, arm]).all() and np.array_equal(problem.loose[:, ~arm], loose[:, ~arm])
    wrong = hang(state)
    moved, stayed = (settle_doubtful(arms, problem, wrong, None, own, movable=True)[0] for own in (NONE, rested))
    assert not np.array_equal(moved.local, wrong.local) and np.array_equal(stayed.local, wrong.local)


@pytest.mark.parametrize("without", ["times", "masks", "doubt"])
def test_without_times_or_masks_or_a_doubt_arms_stay(hand_in_hair, without, monkeypatch):
    arms, problem, truth = hand_in_hair
    start, asked = hang(truth), LEFT
    if without == "doubt":
        asked = NONE
    else:
        changed = {"seconds": None} if without == "times" else {"outlines": []}
        monkeypatch.setattr(problem, "seen", replace(problem.seen, **changed))
    state, rested = rest_arms(arms, problem, start, asked, NONE)
    assert state is start and not rested.any()


def test_frames_in_which_the_arm_is_elsewhere_do_not_change_the_pose_of_the_others(hand_to_hair):
    arms, problem, truth = hand_to_hair
    stay = Stay(0, 0, FRAMES, 0, FRAMES)
    paths = ArmPaths(isolate_arm(problem, stay), truth, 0, ~NONE[:, 0], NONE[:, 0], arms.height)
    poses = [find_rest(paths, dict.fromkeys(frames, NOT_HERE)) for frames in (range(FRAMES), THERE)]
    frame = THERE[0]
    wrist = [paths.place(frame, pose[None])[0, 2] for pose in poses]
    true = problem.skeleton.pose(truth.local, truth.shape).place[frame, INDEX["left_wrist"]] + truth.transl[frame]
    assert max(np.linalg.norm(wrist - true, axis=1)) < 0.08
    assert np.abs(hiding_pose(0, HAIR) - rotation.log(poses[0][:2])).max() < 0.6
