"""Arms that rest while a person turns, where their points mislead: a hand in the hair, a phone before the chest, folded arms.

Frame by frame several poses explain the points of an arm that trunk or head hide by half, and a fit that begins with an arm that
hangs finds one that lies between. The pose that explains most frames is told by all of them together, and so is a second one, from
which the arm came or to which it goes. They are taken where that is cheaper, motion counted; then the trunk, which the arm had
dragged along, follows, and both are looked for once more.
T frames; sides are 0 left, 1 right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gsac.avatar import rotation
from gsac.stages.smplx.lm.arm_paths import FINER, MOVE, MOVES, ArmPaths, list_poses, measure_turns
from gsac.stages.smplx.lm.doubtful_arms import hold
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, FREE, QUICK, STILL, HiddenArms, Stay, isolate_arm, isolate_state
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.state import State

FRAMES = 24
"""Frames, spread over the clip, that tell the pose, at most."""
NOT_HERE = 60.0
"""Cost of a pose from which on a frame says no more against it: the arm may have been elsewhere."""
WEIGHED = 300
"""Poses, the best by points and mask, that are weighed against the body."""
SEARCHES, STEPS = 2, 8
"""Searches, and steps after each in which all but the resting arms moves."""
GOES = 0.5
"""rad, turn of shoulder or elbow from frame to frame from which on the arm goes from one rest to another."""


def rest_arms(arms: HiddenArms, problem: Problem, state: State, asked: np.ndarray, missing: np.ndarray) -> tuple[State, np.ndarray]:
    """The state with arms at rest where that is cheaper, and (T, 2) bool, those arms, which the problem holds nearly still from now
    on, but where it goes. One arm that is asked for asks for both: each hides the other.

    asked: (T, 2) bool, doubtful arms; missing: (T, 2) bool, hands that were not detected. Photos, and clips without masks, stay.
    """
    rested = np.zeros(asked.shape, bool)
    if not asked.any() or problem.seen.seconds is None or not problem.seen.outlines:
        return state, rested
    for _ in range(SEARCHES):
        for side in (0, 1):
            asis, joints = state.local, ARM_JOINTS[side, 1:]
            state = rest_arm(arms, problem, state, side, ~missing[:, side])
            rested[:, side] |= (state.local != asis)[:, joints].any((1, 2, 3))
        if not rested.any():
            return state, rested
        still = np.isin(problem.active, ARM_JOINTS[rested.any(0), 1:])
        held = np.concatenate([np.repeat(still, 3), np.zeros(problem.size - 3 * len(still), bool)])
        state, _ = problem.minimise(state, STEPS, held, np.ones(state.shared, bool))
    for side in np.flatnonzero(rested.any(0)).tolist():
        arm, pose = np.isin(problem.active, ARM_JOINTS[side]), state.local[:, ARM_JOINTS[side, 1:3]]
        leaves = measure_turns(pose[:-1], pose[1:]).max(1) > GOES
        problem.loose[np.ix_(rested[:, side], arm)] = STILL
        problem.loose[np.ix_(np.append(leaves, False) | np.insert(leaves, 0, False), arm)] = QUICK
        problem.spread[np.ix_(rested[:, side], arm)] *= FREE
    return state, rested


def rest_arm(arms: HiddenArms, problem: Problem, state: State, side: int, shown: np.ndarray) -> State:
    """The state with one arm at rest where that is cheaper. shown: (T,) bool, of the hand."""
    whole, local, joints = Stay(side, 0, len(shown), 0, len(shown)), state.local.copy(), ARM_JOINTS[side, 1:]
    alone, asis = isolate_arm(problem, whole), isolate_state(state, whole, state.local)
    hold(arms.cut(whole), alone, asis, side, shown)
    paths = ArmPaths(alone, asis, side, shown, np.zeros(len(shown), bool), arms.height)
    rests = find_rests(paths)
    local[:, joints] = paths.walk([np.concatenate([own[None], rests]) for own in local[:, joints]])
    return replace(state, local=local)


def find_rests(paths: ArmPaths) -> np.ndarray:
    """(2, 3, 3, 3) rotations of shoulder, elbow and wrist: the pose that explains most frames, and the one that explains most of
    those that neither it nor the arm as it is explains."""
    frames = np.unique(np.linspace(0, len(paths.shown) - 1, FRAMES).round().astype(int)).tolist()
    own = paths.state.local[:, ARM_JOINTS[paths.side, 1:]]
    most = find_rest(paths, dict.fromkeys(frames, NOT_HERE))
    left = {t: min(NOT_HERE, float(paths.weigh(t, np.stack([own[t], most])).min())) for t in frames}
    return np.stack([most, find_rest(paths, left)])


def find_rest(paths: ArmPaths, most: dict[int, float]) -> np.ndarray:
    """(3, 3, 3) rotations of the pose that is cheapest over some frames. most: frame -> cost, the most for which it counts."""

    def weigh(weigh_frame: Callable[[int, np.ndarray], np.ndarray], poses: np.ndarray) -> np.ndarray:
        return np.sum([np.minimum(weigh_frame(t, poses), cost) for t, cost in most.items()], axis=0)

    poses = list_poses(paths.side)
    poses = poses[np.argsort(weigh(paths.weigh_alone, poses), kind="stable")[:WEIGHED]]
    moves = np.random.default_rng(0).normal(size=(len(FINER), MOVES, 3, 3)) * MOVE
    for turns in (np.zeros((1, 3, 3)), *(size * own for size, own in zip(FINER, moves, strict=True))):
        tried = np.concatenate([poses, poses[:1] @ rotation.exp(turns)])
        poses = tried[[np.argmin(weigh(paths.weigh, tried))]]
    return poses[0]
