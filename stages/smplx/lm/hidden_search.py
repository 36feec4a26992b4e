"""The search for an arm whose hand is out of sight: it goes as quickly as a gesture, or rests, on the back or elsewhere hidden.

A resting hand turns with the trunk, also in frames that show it: one picture leaves open how deep a hand lies, pictures of one arm
from several sides do not. So an arm that mostly rests as usual is tried with its hand on the back from several moments on. Which
search explains the pictures is judged as paths of doubtful arms are (arm_paths.py): by points, mask, what hides the hand and how
much the arm moves.
F frames; J joints; sides are 0 left, 1 right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gsac.avatar import rotation
from gsac.stages.smplx.lm.arm_paths import ArmPaths
from gsac.stages.smplx.lm.hidden_arms import (
    ARM_JOINTS,
    ELBOW,
    FAR_OFF,
    FREE,
    QUICK,
    ROUGH_DEPTH,
    STEPS,
    STILL,
    WRIST,
    HiddenArms,
    Stay,
    bend_arm,
    isolate_arm,
    isolate_state,
)
from gsac.stages.smplx.lm.outline_points import meet_outlines
from gsac.stages.smplx.lm.problem import ROBUST, Problem
from gsac.stages.smplx.state import State

ON_BACK, ON_BELLY = ((52, 15, -85), (28, -71, 0)), ((20, -12, -88), (16, -67, 0))
"""Rotation vectors, degrees, of the left shoulder and elbow: hand on the small of the back, and on the belly."""
GUESSED = 0.03
"""Spread, as a share of the person's height, that is added to elbow and wrist of a hidden hand: networks make them up."""
NEAR_OFF = 2.0
"""Factor on the robust limit once a search is near: hands that are taken for the other one must not drag the arm along."""
OUTLINES = 2
"""Rounds in which the arm meets the mask's outline, too."""
STEP_S, GOES_S = 0.3, 0.6
"""Seconds between moments at which a rest may begin or end, and that an arm takes to its place."""
EARNS = 2.5
"""By how much each frame of a longer rest must lower the cost: what an arm does in plain view its points tell."""
USUAL = 0.15
"""rad, spread of an arm that is as usual."""


def search_hidden(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray) -> State:
    """The state with the arms of all stays as they fit best; also loosens their motion and distrusts what was made up.

    missing: (T, 2) bool, hands that were not detected.
    """
    state = replace(state, local=state.local.copy())
    for stay in arms.stays:
        frames, arm = slice(stay.first, stay.last), ARM_JOINTS[stay.side]
        for point, guessed in ((ELBOW[stay.side], GUESSED / 2), (WRIST[stay.side], GUESSED)):
            problem.seen.spread[frames, point] = np.hypot(problem.seen.spread[frames, point], guessed * arms.height)
        problem.loose[stay.around, np.isin(problem.active, arm)] = QUICK
        problem.spread[stay.around, np.isin(problem.active, arm)] *= FREE
        asis, shown = state.local[stay.around], ~missing[stay.around, stay.side].astype(bool)
        alone = isolate_arm(problem, stay)
        alone.seen.depth_spread = np.broadcast_to(alone.seen.depth_spread, alone.seen.depth.shape).copy()
        alone.seen.depth_spread[:, [ELBOW[stay.side], WRIST[stay.side]]] = ROUGH_DEPTH
        judge = ArmPaths(alone, isolate_state(state, stay, asis), stay.side, shown, np.zeros_like(shown), arms.height)
        starts = [asis, *(way for pose in (ON_BACK, ON_BELLY) for way in list_ways(asis, stay, pose))]
        search = Search(arms, problem, state, judge)
        found = [search.find(replace(stay, rests=rests), starts) for rests in (False, True)]
        if stay.usual is not None:
            found.append(rest_on_back(search, stay))
        best = min(found, key=lambda each: each.cost)
        stay.rests, stay.on_back, stay.wider = best.stay.rests, best.stay.on_back, best.stay.wider
        state.local[stay.around] = best.local
    for stay in arms.stays:
        if stay.rests:
            problem.loose[stay.resting, np.isin(problem.active, ARM_JOINTS[stay.side])] = STILL
        if stay.on_back:
            expect_on_back(problem, stay)
    return state


@dataclass(frozen=True)
class Found:
    """An arm as a search found it."""

    stay: Stay
    cost: float
    local: np.ndarray
    """(F, J, 3, 3) joint rotations of the stay's frames."""


@dataclass(frozen=True)
class Search:
    """Searches in which only one arm moves."""

    arms: HiddenArms
    problem: Problem
    state: State
    judge: ArmPaths

    def find(self, stay: Stay, starts: list[np.ndarray]) -> Found:
        """The best from several starts, by the problem's own cost; the judge's is told. starts: (F, J, 3, 3) joint rotations."""
        alone, hidden = isolate_arm(self.problem, stay), replace(self.arms, stays=[stay]).cut(stay)
        own = stay.shift(stay.start, stay.stop - stay.start)
        if stay.rests:
            alone.loose[own.resting] = STILL
        if stay.on_back:
            expect_on_back(alone, own)
            expect_usual(alone, own)

        def bend(trial: State) -> State:
            hidden.hold(alone, trial)
            return bend_arm(alone, trial, STEPS)

        tries, costs = [], []
        for start in starts:
            trial = isolate_state(self.state, stay, start)
            for off in (FAR_OFF, NEAR_OFF):
                alone.limit = off * ROBUST
                trial = bend(trial)
            hidden.hold(alone, trial)
            tries.append(trial)
            costs.append(alone.cost(trial))
        best = tries[int(np.argmin(costs))]
        alone.outline_weight = self.problem.outline_weight
        for _ in range(OUTLINES):
            alone.outline_pairs, _ = meet_outlines(alone, best)
            best = bend(best)
        cost = self.judge.cost(best.local) + (self.judge.measure_apart(best.local, range(*own.held)) if stay.on_back else 0)
        return Found(stay, cost, best.local)


def rest_on_back(search: Search, stay: Stay) -> Found:
    """The arm with its hand on the back, from and until when that costs least; before and after it is as usual."""
    seconds, asis = search.problem.seen.seconds, search.state.local[stay.around]
    assert seconds is not None  # without times there are no stays
    step = max(1, round(STEP_S / float(np.median(np.diff(seconds)))))

    def attempt(first: int, last: int) -> Found:
        held = replace(stay, rests=True, on_back=True, wider=(first, last))
        return search.find(held, list_ways(asis, held, ON_BACK)[:1])

    def weigh(found: Found) -> float:
        first, last = found.stay.held
        return found.cost + EARNS * (last - first)

    begun = min((attempt(first, stay.last) for first in range(stay.first, stay.start - 1, -step)), key=weigh)
    return min([begun, *(attempt(begun.stay.held[0], last) for last in range(stay.last + step, stay.stop + 1, step))], key=weigh)


def expect_on_back(problem: Problem, stay: Stay) -> None:
    """Tells the pose prior that the stay's hand lies on the back."""
    joints = [int(np.flatnonzero(problem.active == joint)[0]) for joint in ARM_JOINTS[stay.side, 1:3]]
    problem.mean[slice(*stay.held), joints] = hiding_pose(stay.side, ON_BACK)


def expect_usual(alone: Problem, stay: Stay) -> None:
    """Tells the pose prior of an arm's own problem that the arm rests as usual before it goes to its place, and after."""
    seconds, (first, last) = alone.seen.seconds, stay.held
    assert seconds is not None and stay.usual is not None  # only an arm with a usual pose is tried on the back
    away = (seconds < seconds[first] - GOES_S) | (seconds > seconds[last - 1] + GOES_S)
    alone.mean[away], alone.spread[away], alone.loose[away] = rotation.log(stay.usual), USUAL, STILL


def list_ways(asis: np.ndarray, stay: Stay, pose: tuple) -> list[np.ndarray]:
    """Joint rotations (F, J, 3, 3) to search from: the hiding pose with the way to it, and alone.

    asis: (F, J, 3, 3) of the stay's frames; pose: ON_BACK or ON_BELLY.
    """
    frame, (first, last), out = np.arange(stay.start, stay.stop), stay.held, []
    away = np.maximum(np.maximum(first - frame, frame - last + 1), 0)
    ramp = np.clip(1 - away / max(away.max(), 1), 0, 1)[:, None, None]
    joints, goal = ARM_JOINTS[stay.side, 1:3], hiding_pose(stay.side, pose)
    for share in (ramp, np.ones_like(ramp)):
        start = asis.copy()
        start[:, joints] = rotation.exp((1 - share) * rotation.log(asis[:, joints]) + share * goal)
        out.append(start)
    return out


def hiding_pose(side: int, pose: tuple) -> np.ndarray:
    """Rotation vectors (2, 3) of shoulder and elbow of a side. pose: ON_BACK or ON_BELLY."""
    return np.radians(np.array(pose, float)) * ([1, 1, 1] if side == 0 else [1, -1, -1])
