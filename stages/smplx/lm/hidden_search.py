"""The search for an arm whose hand is out of sight: it goes as quickly as a gesture, or rests on the back or on the belly.

A resting hand turns with the trunk. So, of an arm that mostly rests, its place is sought on either side of the trunk, and the rest
lasts as long as the arm so found explains elbow and wrist, also in frames in which the hand is seen: one picture leaves open how
deep a hand lies, pictures of one arm from several sides do not.
F frames; J joints; sides are 0 left, 1 right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.avatar import rotation
from gsac.stages.smplx.lm.hidden_arms import (
    ARM_JOINTS,
    ELBOW,
    FREE,
    QUICK,
    STEPS,
    STILL,
    WRIST,
    HiddenArms,
    Stay,
    bend_arm,
    find_median,
    isolate_arm,
    isolate_state,
)
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.state import State

BACK, BELLY = -1, 1
HIDES = {BACK: ((52, 15, -85), (28, -71, 0)), BELLY: ((20, -12, -88), (16, -67, 0))}
"""Place of a stay -> rotation vectors, degrees, of the left shoulder and elbow: hand on the small of the back, and on the belly."""
GUESSED = 0.03
"""Spread, as a share of the person's height, that is added to elbow and wrist of a hidden hand: networks make them up."""
TOLD = 0.05
"""Share of the person's height from a resting arm's elbow and wrist to their points, at most, in frames that it explains."""
TELLS = 4.0
"""What each such frame counts against the cost, when one of two places is chosen."""
RESTLESS = 1.25
"""Factor on the cost of a search from which on resting costs too much: 1.18 at most with a hand on the back, 1.32 with one that
talks."""


def search_hidden(arms: HiddenArms, problem: Problem, state: State) -> State:
    """The state with the arms of all stays as they fit best; also loosens their motion and distrusts what was made up."""
    state = replace(state, local=state.local.copy())
    for stay in arms.stays:
        frames, arm = slice(stay.first, stay.last), ARM_JOINTS[stay.side]
        for point, guessed in ((ELBOW[stay.side], GUESSED / 2), (WRIST[stay.side], GUESSED)):
            problem.seen.spread[frames, point] = np.hypot(problem.seen.spread[frames, point], guessed * arms.height)
        problem.loose[stay.around, np.isin(problem.active, arm)] = QUICK
        problem.spread[stay.around, np.isin(problem.active, arm)] *= FREE
        asis = state.local[stay.around]
        ways = {place: list_ways(asis, stay, pose) for place, pose in HIDES.items()}
        starts = [asis, *ways[BACK], *ways[BELLY]]
        cost, local = fit_best(arms, problem, state, stay, starts, QUICK)
        placed, least, resting = stay, np.inf, asis
        if stay.calm:
            tries = [rest(arms, problem, state, replace(stay, place=place), [asis, *own]) for place, own in ways.items()]
            placed, least, resting = min(tries, key=lambda found: found[1] - TELLS * np.ptp(found[0].held))
        if placed.place != BACK:  # before the belly a hand is detected wherever the camera sees it: it is behind the trunk
            placed, (least, resting) = stay, fit_best(arms, problem, state, stay, starts, STILL)
        stay.rests = bool(least < RESTLESS * cost)
        if stay.rests:
            stay.place, stay.wider, local = placed.place, placed.wider, resting
        if stay.rests and stay.place == BACK:
            start = resting.copy()
            start[stay.held[0] - stay.start:stay.held[1] - stay.start, arm] = find_pose(resting, stay)
            _, local = fit_best(arms, problem, state, stay, [start], STILL)
        state.local[stay.around] = local
    for stay in arms.stays:
        if stay.rests:
            problem.loose[stay.resting, np.isin(problem.active, ARM_JOINTS[stay.side])] = STILL
    return state


def rest(arms: HiddenArms, problem: Problem, state: State, stay: Stay, starts: list[np.ndarray]) -> tuple[Stay, float, np.ndarray]:
    """The stay at its place, as long as its arm explains elbow and wrist; cost and joint rotations (F, J, 3, 3) of its frames.

    starts: (F, J, 3, 3) joint rotations to search from.
    """
    cost, local = fit_best(arms, problem, state, stay, starts, STILL)
    still, rows = replace(state, local=state.local.copy()), [ELBOW[stay.side], WRIST[stay.side]]
    still.local[stay.around, ARM_JOINTS[stay.side]] = find_pose(local, stay)
    uv = problem.project(still, problem.locate_points(problem.skeleton.pose(still.local, still.shape), still))[:, rows]
    off = np.where(np.isfinite(problem.seen.spread[:, rows, None]), uv - np.nan_to_num(problem.seen.xy[:, rows]), 0)
    told = np.linalg.norm(off, axis=-1).max(1) < TOLD * arms.height
    first, last = stay.first, stay.last
    while first > stay.start and told[first - 1]:
        first -= 1
    while last < stay.stop and told[last]:
        last += 1
    return replace(stay, wider=(first, last)), cost, local


def find_pose(local: np.ndarray, stay: Stay) -> np.ndarray:
    """(4, 3, 3) rotations of the stay's arm while its hand is out of sight. local: (F, J, 3, 3) of the stay's frames."""
    return find_median(local[stay.first - stay.start:stay.last - stay.start, ARM_JOINTS[stay.side]])


def list_ways(asis: np.ndarray, stay: Stay, pose: tuple) -> list[np.ndarray]:
    """Joint rotations (F, J, 3, 3) to search from: the hiding pose with the way to it, and alone.

    asis: (F, J, 3, 3) of the stay's frames; pose: one of `HIDES`.
    """
    frame, out = np.arange(stay.start, stay.stop), []
    away = np.maximum(np.maximum(stay.first - frame, frame - stay.last + 1), 0)
    ramp = np.clip(1 - away / max(away.max(), 1), 0, 1)[:, None, None]
    joints, goal = ARM_JOINTS[stay.side, 1:3], hiding_pose(stay.side, pose)
    for share in (ramp, np.ones_like(ramp)):
        start = asis.copy()
        start[:, joints] = rotation.exp((1 - share) * rotation.log(asis[:, joints]) + share * goal)
        out.append(start)
    return out


def hiding_pose(side: int, pose: tuple) -> np.ndarray:
    """Rotation vectors (2, 3) of shoulder and elbow of a side. pose: one of `HIDES`."""
    return np.radians(np.array(pose, float)) * ([1, 1, 1] if side == 0 else [1, -1, -1])


def fit_best(arms: HiddenArms, problem: Problem, state: State, stay: Stay, starts: list[np.ndarray],
             speed: float) -> tuple[float, np.ndarray]:
    """Lowest cost and joint rotations (F, J, 3, 3) of the stay's frames after searches in which only this arm moves.

    starts: (F, J, 3, 3) joint rotations; speed: factor on the spreads of its motion while it rests.
    """
    alone = isolate_arm(problem, stay)
    alone.loose[stay.shift(stay.start, stay.stop - stay.start).resting] = speed
    found = []
    for start in starts:
        hidden, trial = replace(arms, stays=[stay]).cut(stay), isolate_state(state, stay, start)
        for _ in range(2):
            hidden.hold(alone, trial)
            trial = bend_arm(alone, trial, STEPS)
        hidden.hold(alone, trial)
        found.append((alone.cost(trial), trial.local))
    return min(found, key=lambda fit: fit[0])
