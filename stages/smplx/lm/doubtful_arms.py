"""Arms that the pictures contradict, or do not tell: they are said, and moved where another pose is clearly right.

An arm is doubtful where its points lie elsewhere for some frames, far off in one, or in one in which the mask shows a limb that the
body does not cover, where its hand is seen although it lies inside the trunk, where its hand has moved while nothing told where it
was, or where its hand is out of sight for more of a turn than a trunk covers. Its path is then searched among all that arms can do;
one that explains the pictures much better takes its place.
T frames; sides are 0 left, 1 right.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from gsac.avatar.joints import INDEX
from gsac.avatar.yaw import yaw
from gsac.avatar.zbuffer import silhouette
from gsac.stages.smplx.jacobians import Chain
from gsac.stages.smplx.lm.arm_paths import BARE, THIN, ArmPaths
from gsac.stages.smplx.lm.hidden_arms import (
    ARM_JOINTS,
    BEHIND_SPREAD,
    ELBOW,
    ROUGH_DEPTH,
    SKIN,
    TRUSTED,
    WRIST,
    HiddenArms,
    Stay,
    bend_arm,
    bridge,
    find_around,
    isolate_arm,
    isolate_state,
)
from gsac.stages.smplx.lm.mirrored_arms import find_mirrored, measure_unrest
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.state import State, to_params

FAR, ASTRAY, DOUBTS = 4.5, 2.5, 3
"""Of doubtful arms: spreads from a point, in any frame (3.5 at most in clean turns, 5.3 with a hand on the hip seen from behind),
and in so many frames on end (1.9; 3.2 with a hand on the back that is taken for one before the belly)."""
ALONE, BESIDE, UNCOVERED = 3.0, 0.02, 0.0012
"""Of an arm that is doubtful in one frame: spreads from a point; distance from the body, and area beyond it, of the mask's part
that the body leaves, as shares of the person's height and its square. An arm on its way to hip or hair is 3.4 on off and leaves
0.0017 on; in clean turns one may be 3.5 off, or the body leave 0.0015, but not both."""
ARC = np.radians(90)
"""Turn without the hand: 51 degrees in clean turns, 114 on with a phone."""
MOVED, LOST = 0.11, 0.03
"""m by which a hand has moved on the trunk while it was not detected, and a share of the person's height, the spread of a wrist
that nothing tells. Hanging arms move by 83 mm in turns of 20 frames, hands that went to the hips or the back by 138 on."""
DEEP = 0.03
"""m inside the trunk from which on a hand would not be seen."""
BETWEEN = 4
"""Frames between a mirrored arm and a hidden one that are no surer than these."""
STEPS = 8
"""Steps from the cheapest path on."""
CLEARLY = 20.0
"""By how much the cost must fall before an arm takes another path; and by how much a finer fit to the points may cost more than its
path, which knows them only roughly."""


def find_contradicted(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray) -> np.ndarray:
    """(T, 2) bool, arms far from their points, or beside the mask too, or inside the trunk although their hand is seen.

    missing: (T, 2) bool, hands that were not detected.
    """
    seen, chain = problem.seen, problem.skeleton.pose(state.local, state.shape)
    uv = problem.project(state, problem.locate_points(chain, state))
    off = np.linalg.norm(np.where(np.isfinite(seen.spread)[..., None], uv - seen.xy, 0), axis=-1) / seen.spread
    out = np.zeros(missing.shape, bool)
    for side in (0, 1):
        arm = off[:, [ELBOW[side], WRIST[side]]].max(1)
        sunk = ~missing[:, side] & np.isfinite(find_near(arms, state, chain, side))
        for first, last in bridge(arm > FAR):
            out[first:last, side] = True
        for first, last in [*bridge(arm > ASTRAY, 0), *bridge(sunk, 0)]:
            out[first:last, side] |= last - first >= DOUBTS
        far = np.flatnonzero(arm > ALONE)
        out[far, side] |= measure_uncovered(arms, problem, state, far) > UNCOVERED
    return out & ~arms.mark_held(len(out))


def measure_uncovered(arms: HiddenArms, problem: Problem, state: State, frames: np.ndarray) -> np.ndarray:
    """(F,) area of the mask beside the body, as a share of the person's height squared; 0 without a mask. frames: (F,)."""
    out, offsets = np.zeros(len(frames)), problem.person_offsets
    if not problem.seen.outlines:
        return out
    assert offsets is not None  # only an arm's or a hand's own problem may lack them
    params = to_params(problem.body, state, problem.seen.center, joint_offset=offsets.joint_offset(state.own))
    for i, t in enumerate(frames.tolist()):
        outline = problem.seen.outlines[t]
        h, w = outline.mask.shape
        camera = params.camera(round(w * outline.scale), round(h * outline.scale)).scaled(w, h)
        body = silhouette(problem.body.posed(params, [t])[0][0], problem.body.faces, camera)
        away = cv2.distanceTransform((body == 0).astype(np.uint8), cv2.DIST_L2, 5)
        pixel = outline.scale / arms.height
        out[i] = (outline.mask & (away * pixel > BESIDE)).sum() * pixel**2
    return out


def find_untold(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray) -> np.ndarray:
    """(T, 2) bool, arms whose hand moved while nothing told where it was, or for more of the turn than a trunk covers a hand.

    missing: (T, 2) bool, hands that were not detected.
    """
    chain, turn, out = problem.skeleton.pose(state.local, state.shape), yaw(state.local[:, 0]), np.zeros(missing.shape, bool)
    for side in (0, 1):
        for first, last in bridge(missing[:, side]):
            others, around = np.delete(missing[:, side], np.s_[first:last]), np.ptp(np.unwrap(turn[first:last]))
            away = around > ARC or has_moved(arms, problem, chain, side, first, last)
            out[first:last, side] |= len(others) >= DOUBTS and 1 - others.mean() > TRUSTED and away
    return out & ~arms.mark_held(len(out))


def find_near(arms: HiddenArms, state: State, chain: Chain, side: int) -> np.ndarray:
    """(T,) m, depth of the trunk's near surface where a wrist lies inside the trunk; NaN where it does not."""
    out = np.full(len(state.local), np.nan)
    for t, wrist in enumerate(chain.place[:, ARM_JOINTS[side, 3]] + state.transl):
        near, far = arms.measure_trunk(state, chain.frame(t), t, wrist)
        if near + DEEP < wrist[2] < far + BEHIND_SPREAD:
            out[t] = near
    return out


def has_moved(arms: HiddenArms, problem: Problem, chain: Chain, side: int, first: int, last: int) -> bool:
    """Whether a hand lies elsewhere on the trunk before and after frames, `last` exclusive, and nothing tells when it went."""
    chest, wrist, ends = INDEX["spine3"], ARM_JOINTS[side, 3], [max(first - 1, 0), min(last, len(chain.place) - 1)]
    before, after = np.einsum("tba,tb->ta", chain.world[ends, chest], chain.place[ends, wrist] - chain.place[ends, chest])
    unknown = problem.seen.spread[first:last, WRIST[side]].max() > LOST * arms.height
    return bool(unknown and np.linalg.norm(after - before) > MOVED)


def settle_doubtful(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray | None, rested: np.ndarray,
                    movable: bool) -> tuple[State, np.ndarray]:
    """The state with doubtful arms in poses that explain points and mask clearly better, where there are any; and (T, 2) bool, the
    doubtful arms that no stay has.

    missing: (T, 2) bool, hands that were not detected; None: all were; rested: (T, 2) bool, arms at rest, which stay; movable:
    whether the pictures tell one pose of an arm from another, else all arms stay as they are.
    """
    missing = np.zeros((len(state.local), 2), bool) if missing is None else missing.astype(bool)
    mirrored, calm = find_mirrored(arms, problem, state, missing)
    loose = ~(arms.mark_searched(len(missing)) | rested)  # where an arm rests, or its hand on the back, was judged as paths are
    state = unmirror(arms, problem, state, mirrored & loose, calm, missing) if movable else state
    doubtful = find_contradicted(arms, problem, state, missing) | find_untold(arms, problem, state, missing)
    if movable:
        state = move(arms, problem, state, doubtful & loose, missing)
        state = move(arms, problem, state, with_stays(arms, mirrored & loose), missing, BARE)
    return state, doubtful | mirrored


def with_stays(arms: HiddenArms, mirrored: np.ndarray) -> np.ndarray:
    """(T, 2) bool, stays that were searched from mirrored arms, with those and the frames between: where the hand hides is told by
    the frames that were mirrored. mirrored: (T, 2) bool.
    """
    out = np.zeros_like(mirrored)
    for stay in arms.stays:
        if mirrored[stay.around, stay.side].any():
            out[stay.around, stay.side] |= mirrored[stay.around, stay.side]
            out[stay.first:stay.last, stay.side] = True
    for side in (0, 1):
        for first, last in bridge(out[:, side], BETWEEN):
            out[first:last, side] = True
    return out


def unmirror(arms: HiddenArms, problem: Problem, state: State, mirrored: np.ndarray, calm: np.ndarray,
             missing: np.ndarray) -> State:
    """The state with arms of a calmer sequence, where its cost, with that of the points and the mask, is lower.

    mirrored: (T, 2) bool, those arms; calm: (T, J, 3, 3) joint rotations of the sequence; missing: (T, 2) bool, hands that were not
    detected.
    """
    settled = state
    for stay in list_windows(problem, mirrored):
        shown = ~missing[stay.around, stay.side]
        asis, other = (isolate_state(settled, stay, local[stay.around]) for local in (settled.local, calm))
        judge, free, held = isolate_arm(problem, stay), isolate_arm(problem, stay), isolate_arm(problem, stay)
        for alone, start in ((judge, asis), (free, other), (held, other)):
            hold(arms.cut(stay), alone, start, stay.side, shown)
        hold_depth(held, other, stay.side, mirrored[stay.around, stay.side])
        costs, found = [], []
        for alone, start in ((judge, asis), (free, other), (held, other)):
            bent, local = bend_arm(alone, start, STEPS), settled.local.copy()
            local[stay.around] = bent.local
            found.append(replace(settled, local=local))
            costs.append(judge.cost(bent) + measure_unrest(arms, problem, found[-1], missing, stay.side))
        best = int(np.argmin(costs))
        settled = found[best] if best else settled
    return settled


def hold_depth(alone: Problem, state: State, side: int, frames: np.ndarray) -> None:
    """Tells the arm's problem that elbow and wrist lie as deep as in the state in some frames, (F,) bool."""
    x = alone.locate_points(alone.skeleton.pose(state.local, state.shape), state)[..., 2]
    at = np.ix_(frames, np.array([ELBOW[side], WRIST[side]]))
    alone.seen.depth[at] = (x - x[:, list(alone.hips)].mean(1, keepdims=True))[at]
    alone.seen.depth_spread = np.broadcast_to(alone.seen.depth_spread, x.shape).copy()
    alone.seen.depth_spread[at] = BEHIND_SPREAD


def move(arms: HiddenArms, problem: Problem, state: State, doubtful: np.ndarray, missing: np.ndarray,
         bare: tuple[float, ...] = THIN) -> State:
    """The state with arms in poses that explain points and mask clearly better, where there are any.

    doubtful: (T, 2) bool, those arms; missing: (T, 2) bool, hands that were not detected; bare: of `ArmPaths`.
    """
    settled = replace(state, local=state.local.copy())
    for stay in list_windows(problem, doubtful):
        shown = ~missing[stay.around, stay.side]
        settled.local[stay.around] = search(arms, problem, settled, stay, shown, shown & ~doubtful[stay.around, stay.side], bare)
    return settled


def list_windows(problem: Problem, doubtful: np.ndarray) -> list[Stay]:
    """Frames in which an arm is doubtful, and those around in which it is searched again; none of photos, and without masks.

    doubtful: (T, 2) bool.
    """
    seconds, out = problem.seen.seconds, []
    if seconds is None or not problem.seen.outlines:
        return out
    for side in np.flatnonzero(doubtful.any(0)).tolist():
        around = np.zeros(len(doubtful), bool)
        for first, last in bridge(doubtful[:, side]):
            around[slice(*find_around(seconds, first, last))] = True
        for start, stop in bridge(around, 0):
            doubted = start + np.flatnonzero(doubtful[start:stop, side])
            out.append(Stay(side, int(doubted[0]), int(doubted[-1]) + 1, start, stop))
    return out


def search(arms: HiddenArms, problem: Problem, state: State, stay: Stay, shown: np.ndarray, sure: np.ndarray,
           bare: tuple[float, ...]) -> np.ndarray:
    """Joint rotations (F, J, 3, 3) of the stay's frames: as they are unless others are clearly better.

    shown: (F,) bool, of the hand; sure: (F,) bool, frames in which the arm is not doubtful; bare: of `ArmPaths`.
    """
    alone, asis = isolate_arm(problem, stay), isolate_state(state, stay, state.local[stay.around])
    hold(arms.cut(stay), alone, asis, stay.side, shown)
    paths = ArmPaths(alone, asis, stay.side, shown, sure, arms.height, bare)
    path = isolate_state(state, stay, paths.find([asis.local]))
    bent = bend_arm(alone, path, STEPS)
    best = bent if paths.cost(bent.local) < paths.cost(path.local) + CLEARLY else path
    return best.local if paths.cost(best.local) < paths.cost(asis.local) - CLEARLY else asis.local


def hold(arms: HiddenArms, alone: Problem, state: State, side: int, shown: np.ndarray) -> None:
    """Tells the arm's problem that it lies inside the mask, and its hand before the trunk where it is seen, and not inside it.

    shown: (F,) bool, of the hand.
    """
    arms.hold(alone, state)
    alone.inside = [(t, arms.forearm[side]) for t, outline in enumerate(alone.seen.outlines) if outline.area > 0]
    seen, wrist, hidden = alone.seen, WRIST[side], arms.mark(len(shown))[:, side]
    spread = np.broadcast_to(seen.depth_spread, seen.depth.shape).copy()
    spread[~hidden, ELBOW[side]] = spread[~hidden, wrist] = ROUGH_DEPTH
    chain = alone.skeleton.pose(state.local, state.shape)
    hips = alone.locate_points(chain, state)[:, list(alone.hips), 2].mean(1)
    near = find_near(arms, state, chain, side)
    sunk = shown & ~hidden & np.isfinite(near)
    seen.depth[sunk, wrist], spread[sunk, wrist] = (near - SKIN - hips)[sunk], BEHIND_SPREAD
    seen.depth_spread = spread
