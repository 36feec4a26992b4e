"""Paths of an arm through the poses that people can take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.stages.smplx.lm import fit
from gsac.stages.smplx.lm.arm_paths import BARE, QUICKEST, THIN, ArmPaths, list_poses
from gsac.stages.smplx.lm.doubtful_arms import find_contradicted
from gsac.stages.smplx.lm.fit import move_contradicted
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, ELBOW, HAND, WRIST, Stay, isolate_arm
from gsac.stages.smplx.lm.hidden_search import ON_BELLY, hiding_pose
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.prior import BODY_JOINTS
from support.bent_arm import HAIR, distances, person_with, with_left_arm

FRAMES, BENT = 10, range(3, 8)
ALL = np.ones(FRAMES, bool)
SHOULDER, ELBOW_JOINT = ARM_JOINTS[0, 1:3]
ASIDE = ((0, 0, 0), (0, -30, 0))
"""Rotation vectors, degrees, of the left shoulder and elbow."""


def paths_of(arms, problem, state, shown):
    stay = Stay(0, BENT[0], BENT[-1] + 1, 0, FRAMES)
    return ArmPaths(isolate_arm(problem, stay), state, 0, shown, ~ALL, arms.height)


def hang(state):
    """The state with the left arm as in the first frame."""
    return with_left_arm(state, state.local[0, ARM_JOINTS[0, 1:]])


def blind(problem):
    """The problem without points of the left arm."""
    spread = problem.seen.spread.copy()
    spread[:, [ELBOW[0], WRIST[0], *HAND[0]]] = np.inf
    depth = problem.seen.depth.copy()
    depth[:, [ELBOW[0], WRIST[0]]] = np.nan
    seen = replace(problem.seen, spread=spread, depth=depth)
    return Problem(problem.body, problem.pairs, problem.hips, seen, BODY_JOINTS, problem.smoothness, problem.person_offsets)


@pytest.fixture(scope="module")
def hand_in_hair(body, tmp_path_factory):
    return person_with(body, tmp_path_factory.mktemp("hair"), HAIR, np.linspace(-0.8, 0.8, FRAMES), BENT)


@pytest.fixture(scope="module")
def arm_aside(body, tmp_path_factory):
    return person_with(body, tmp_path_factory.mktemp("aside"), ASIDE, np.linspace(-0.5, 0.5, FRAMES), BENT)


@pytest.fixture(scope="module")
def hand_on_belly(body, tmp_path_factory):
    return person_with(body, tmp_path_factory.mktemp("belly"), ON_BELLY, np.pi + np.linspace(-0.4, 0.4, FRAMES), BENT)


def test_an_arm_that_hangs_in_the_fit_finds_its_way_to_the_hair(hand_in_hair):
    arms, problem, truth = hand_in_hair
    start = hang(truth)
    path = paths_of(arms, problem, start, ALL).find([start.local])
    for joint, most in (("left_elbow", 0.06), ("left_wrist", 0.07)):
        before, after = (distances(problem, truth, local, joint)[BENT] for local in (start.local, path))
        assert before.min() > 0.25 and np.median(after) < most
    others = np.delete(np.arange(55), ARM_JOINTS[0, 1:])
    assert np.array_equal(path[:, others], start.local[:, others])


def test_an_elbow_whose_points_are_missing_lies_where_the_mask_shows_a_limb(arm_aside):
    arms, problem, truth = arm_aside
    start = hang(truth)
    path = paths_of(arms, blind(problem), start, ALL).find([start.local])
    place = [problem.skeleton.pose(local, truth.shape).place[:, ELBOW_JOINT] + truth.transl
             for local in (truth.local, start.local, path)]
    true, before, after = (problem.project(truth, x)[BENT] for x in place)
    assert np.linalg.norm(before - true, axis=1).min() > 0.08 * arms.height
    assert np.linalg.norm(after - true, axis=1).max() < 0.03 * arms.height


def test_skin_outside_the_mask_costs_where_middle_lines_inside_do_not(arm_aside):
    arms, problem, truth = arm_aside
    stay, t = Stay(0, BENT[0], BENT[-1] + 1, 0, FRAMES), BENT[2]
    lines, skin = (ArmPaths(isolate_arm(blind(problem), stay), truth, 0, ALL, ~ALL, arms.height, bare) for bare in (THIN, BARE))
    poses = np.repeat(truth.local[t, ARM_JOINTS[0, 1:]][None], 2, 0)
    poses[1, 0] = rotation.exp(np.radians([0, 0, 9.0])) @ poses[1, 0]  # raised by half of its width
    of_lines, of_skin = (np.diff(paths.weigh_alone(t, poses)) for paths in (lines, skin))
    assert of_lines < 1 and of_skin > of_lines + 2


def test_a_hand_that_is_not_seen_is_hidden_by_the_body_and_touches_it(hand_on_belly):
    arms, problem, truth = hand_on_belly
    start, shown = hang(truth), ALL.copy()
    shown[BENT] = False
    paths = paths_of(arms, blind(problem), start, shown)
    path = paths.find([start.local])
    for t in BENT:
        x = paths.place(t, path[t, ARM_JOINTS[0, 1:]][None])[0]
        assert paths.around[t].hides(problem.project(truth, x[3])[None], x[[3], 2]).all()
        assert -0.01 < paths.around[t].measure_clearance(x[3]) < 0.1


def test_a_hand_inside_the_trunk_costs_more_than_one_on_it(hand_on_belly):
    arms, problem, truth = hand_on_belly
    paths = paths_of(arms, blind(problem), truth, ~ALL)
    for t in BENT:
        deepest = min(list_poses(0), key=lambda pose: paths.around[t].measure_clearance(paths.place(t, pose[None])[0, 3]))
        on, within = paths.weigh(t, np.stack([truth.local[t, ARM_JOINTS[0, 1:]], deepest]))
        assert within > on + 20


def test_a_hand_that_should_rest_on_the_body_costs_more_the_farther_it_lies_from_it(hand_on_belly):
    arms, problem, truth = hand_on_belly
    paths = paths_of(arms, problem, truth, ~ALL)
    on, beside = (paths.measure_apart(state.local, range(BENT[0], BENT[-1] + 1)) for state in (truth, hang(truth)))
    assert beside > 4 * len(BENT) > on


def test_rest_costs_nothing_a_gesture_no_more_however_quick_and_what_nobody_can_do_more(hand_in_hair):
    arms, problem, truth = hand_in_hair
    paths = paths_of(arms, problem, truth, ALL)
    still = np.tile(np.eye(3), (3, 1, 1))
    gap = np.diff(problem.seen.seconds)[0]

    def cost(speed):
        turn = rotation.exp(np.full((2, 3), speed * gap) * (0, 1, 0))
        return float(paths.measure_motion(1, still, np.concatenate([turn, still[:1]])))

    assert cost(0.0) == 0 < cost(0.2) < cost(4.0) and cost(QUICKEST) < 1.1 * cost(4.0) and cost(2 * QUICKEST) > 1.5 * cost(QUICKEST)


def test_poses_of_the_right_arm_mirror_those_of_the_left():
    left, right = (rotation.log(list_poses(side)) for side in (0, 1))
    assert len(left) > 3000 and np.allclose(right, left * (1, -1, -1), atol=1e-9)
    assert (np.abs(left[:, 0] - hiding_pose(0, HAIR)[0]).max(1) < 0.5).any()


def test_only_arms_that_rest_or_move_before_the_rounds_are_still_or_free_from_then_on(hand_in_hair):
    arms, problem, truth = hand_in_hair
    loose, spread = problem.loose.copy(), problem.spread.copy()
    state, moved, rested = move_contradicted(arms, problem, truth, None)
    assert not (moved | rested).any() and np.array_equal(state.local, truth.local) and np.array_equal(problem.loose, loose)
    state, moved, rested = move_contradicted(arms, problem, hang(truth), None)
    assert (moved | rested)[BENT, 0].all() and not (moved | rested)[:, 1].any() and not (moved & rested).any()
    slower, quicker, wider = problem.loose < loose, problem.loose > loose, (problem.spread > spread).any(2)
    assert np.array_equal(wider.any(1), (moved | rested)[:, 0]) and (slower | quicker).any(1)[BENT].all()
    assert not slower.any(1)[~rested[:, 0]].any() and quicker.any(1)[moved[:, 0]].all()
    assert {*BODY_JOINTS[(slower | quicker | wider).any(0)]} <= {*ARM_JOINTS[0]}
    problem.loose[:], problem.spread[:] = loose, spread


def test_doubts_are_worked_out_anew_only_where_an_arm_has_come_to_rest(hand_in_hair, monkeypatch):
    (arms, problem, truth), looked = hand_in_hair, []
    loose, spread = problem.loose.copy(), problem.spread.copy()
    monkeypatch.setattr(fit, "find_contradicted", lambda *words: looked.append(words) or find_contradicted(*words))
    assert not move_contradicted(arms, problem, truth, None)[2].any() and len(looked) == 1
    rested = np.zeros((FRAMES, 2), bool)
    rested[BENT, 0] = True
    monkeypatch.setattr(fit, "rest_arms", lambda arms, problem, state, *words: (hang(state), rested))
    assert not move_contradicted(arms, problem, truth, None)[1][BENT, 0].any() and looked[-1][2] is not truth and len(looked) == 3
    problem.loose[:], problem.spread[:] = loose, spread
