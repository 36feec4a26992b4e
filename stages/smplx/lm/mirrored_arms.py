"""Arms that may be mirrored along the view: which of the ways to bend one picture's points leave open lets the arm move least.

A camera sees where an elbow and a wrist lie, and hardly how far away. A bone of known length then leads to one of two places on
the line of sight of its far end, so that one picture has four arms. The body turns: an arm that is mirrored in some frames seems
to jump between them and the others, while the true one rests, or goes quickly once. Of the sequences of such arms the cheapest is
found, by its motion, the detector's depths, and whether the hand is seen where the trunk hides it; where it is clearly cheaper than
the fit's, the arm is doubtful.
T frames, four arms K of a frame, the first as fitted; sides are 0 left, 1 right.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import INDEX
from gsac.avatar.yaw import yaw
from gsac.stages.smplx.jacobians import Chain
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, ELBOW, ROUGH_DEPTH, TRUSTED, WRIST, HiddenArms, bridge
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.lm.solver import robust
from gsac.stages.smplx.state import State

STEP_S = 0.3
"""Seconds between the frames that a sequence goes through, at least: gestures cost the same at any frame rate."""
CALMER, APART = 2.0, 0.1
"""Of frames on end in which the cheapest sequence has another arm than the fit: by how much it must be cheaper than one that has
the fit's arm there (on six clean arms 0.0), and m by which elbow or wrist must lie elsewhere in one of them."""
TURNED = np.radians(30)
"""Turn of the body in such frames and their neighbours, below which nothing tells the arms apart: each of them moves alike."""
SPEED, QUICK = 0.3, 4.0
"""rad/s, spread of the speed of upper arm and forearm against the trunk, and its robust limit, in spreads: an arm rests or goes."""
DEEP = 2.0
"""Robust limit of the detector's depths, in spreads."""
BEHIND, UNLIKELY = 0.03, 4.0
"""m behind the trunk's near surface from which on a hand is hidden; cost of a hand that is seen there, and of one that is not seen
elsewhere, unless the detector hardly finds that hand at all."""
STRAIGHT = np.sin(np.radians(10))
"""Sine of a bend below which a forearm does not tell which way the elbow points."""


def find_mirrored(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 2) bool, arms that lie elsewhere in another sequence that is clearly calmer than the fit's; and joint rotations
    (T, J, 3, 3) of that sequence.

    missing: (T, 2) bool, hands that were not detected.
    """
    doubtful, local, seconds = np.zeros(missing.shape, bool), state.local.copy(), problem.seen.seconds
    if seconds is None or len(missing) < 3:
        return doubtful, local
    chain, some = problem.skeleton.pose(state.local, state.shape), pick_frames(seconds)
    for side in (0, 1):
        hidden, places = arms.mark_held(len(missing))[:, side], list_arms(chain, state, side)
        cost = weigh(arms, problem, state, chain, missing[:, side], places[some], side, some)
        cost[hidden[some], 1:] = np.inf
        away = np.linalg.norm(places[some, :, 1:] - places[some, :1, 1:], axis=-1).max(-1)
        path = find_calmest(cost, measure_motion(chain, places[some], seconds, some), away, yaw(state.local[some, 0]))
        picked = fill_between(path, some, len(missing))
        doubtful[:, side] = (picked > 0) & ~hidden
        for t in np.flatnonzero(doubtful[:, side]).tolist():
            local[t, ARM_JOINTS[side, 1:3]] = turn_arm(chain, t, side, *np.diff(places[t, picked[t]], axis=0))
    return doubtful, local


def measure_unrest(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray, side: int) -> float:
    """Cost of an arm's sequence as the state has it. missing: (T, 2) bool, hands that were not detected."""
    seconds = problem.seen.seconds
    assert seconds is not None  # without times no arm is said to be mirrored
    chain, some = problem.skeleton.pose(state.local, state.shape), pick_frames(seconds)
    places = list_arms(chain, state, side)[some, :1]
    cost = weigh(arms, problem, state, chain, missing[:, side], places, side, some)
    return float(cost.sum() + measure_motion(chain, places, seconds, some).sum())


def pick_frames(seconds: np.ndarray) -> np.ndarray:
    """(N,) those of the frames that sequences go through. seconds: (T,)."""
    return np.arange(0, len(seconds), max(1, round(STEP_S / float(np.median(np.diff(seconds))))))


def list_arms(chain: Chain, state: State, side: int) -> np.ndarray:
    """(T, K, 3, 3) m, shoulder, elbow and wrist of the arms that project to one picture, camera frame."""
    shoulder, elbow, wrist = np.moveaxis(chain.place[:, ARM_JOINTS[side, 1:]] + state.transl[:, None], 1, 0)
    upper, lower = np.linalg.norm(elbow - shoulder, axis=-1), np.linalg.norm(wrist - elbow, axis=-1)
    other = meet(shoulder, upper, elbow)[1]
    ends = [(elbow, wrist), (elbow, meet(elbow, lower, wrist)[1]), *((other, end) for end in meet(other, lower, wrist))]
    return np.stack([np.stack([shoulder, *end], 1) for end in ends], 1)


def meet(centre: np.ndarray, radius: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The two places (T, 3) m at the distance radius (T,) from centre (T, 3) on the line of sight through point (T, 3), the nearer
    one to it first; where the line passes farther off, the place towards it."""
    sight = point / np.linalg.norm(point, axis=-1, keepdims=True)
    along = (sight * centre).sum(-1)
    half = np.sqrt(np.maximum(radius**2 - (centre**2).sum(-1) + along**2, 0))
    ends = np.stack([along - half, along + half])[..., None] * sight - centre
    ends = centre + ends * (radius / np.linalg.norm(ends, axis=-1))[..., None]
    swap = np.linalg.norm(ends[0] - point, axis=-1) > np.linalg.norm(ends[1] - point, axis=-1)
    return np.where(swap[:, None], ends[1], ends[0]), np.where(swap[:, None], ends[0], ends[1])


def weigh(arms: HiddenArms, problem: Problem, state: State, chain: Chain, missing: np.ndarray, places: np.ndarray, side: int,
          some: np.ndarray) -> np.ndarray:
    """(N, K) cost of places (N, K, 3, 3) m by the detector's depths, and by whether the hand is seen, in some frames (N,).

    missing: (T,) bool.
    """
    seen, rows = problem.seen, [ELBOW[side], WRIST[side]]
    hips = problem.locate_points(chain, state)[some][:, list(problem.hips), 2].mean(1)
    depth = places[:, :, 1:, 2] - hips[:, None, None] - seen.depth[some][:, None, rows]
    out = robust(np.nan_to_num(depth / ROUGH_DEPTH), DEEP)[0].sum(-1)
    for i, t in enumerate(some.tolist()):
        if missing[t] and missing.mean() > 1 - TRUSTED:
            continue
        for k, wrist in enumerate(places[i, :, 2]):
            near, _ = arms.measure_trunk(state, chain.frame(t), t, wrist)
            out[i, k] += UNLIKELY * ((np.isfinite(near) and wrist[2] > near + BEHIND) != missing[t])
    return out


def measure_motion(chain: Chain, places: np.ndarray, seconds: np.ndarray, some: np.ndarray) -> np.ndarray:
    """(N - 1, K, K) cost of the way from each arm to each of the next frame, against the trunk.

    places: (N, K, 3, 3) m, in some frames (N,); seconds: (T,).
    """
    bones = np.einsum("tba,tksb->tksa", chain.world[some, INDEX["spine3"]], np.diff(places, axis=2))
    bones /= np.linalg.norm(bones, axis=-1, keepdims=True)
    angle = np.arccos(np.clip(np.einsum("tisa,tjsa->tijs", bones[:-1], bones[1:]), -1, 1))
    return robust(angle / np.diff(seconds[some])[:, None, None, None] / SPEED, QUICK)[0].sum(-1)


def fill_between(picked: np.ndarray, some: np.ndarray, frames: int) -> np.ndarray:
    """(T,) the arm of every frame: what the ones before and after have, the first where they differ. picked: (N,) of frames some
    (N,); frames: T."""
    at = np.searchsorted(some, np.arange(frames))
    before, after = picked[np.searchsorted(some, np.arange(frames), "right") - 1], picked[np.minimum(at, len(some) - 1)]
    return np.where(before == after, before, 0)


def find_calmest(cost: np.ndarray, motion: np.ndarray, away: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(N,) which arm of each frame the cheapest sequence takes (Viterbi 1967), the first where another is no clear gain.

    cost: (N, K) of each arm; motion: (N - 1, K, K) of the ways between them; away: (N, K) m of each arm from the first; angle: (N,)
    rad, the body's turn.
    """
    total, back = cost[0], []
    for own, ways in zip(cost[1:], motion, strict=True):
        whole = total[:, None] + ways
        back.append(whole.argmin(0))
        total = whole.min(0) + own
    picked = [int(total.argmin())]
    for step in reversed(back):
        picked.append(int(step[picked[-1]]))
    path, at = np.array(picked[::-1]), np.arange(len(cost))

    def cost_of(path: np.ndarray) -> float:
        return float(cost[at, path].sum() + motion[at[:-1], path[:-1], path[1:]].sum())

    for first, last in bridge(path > 0, 0):
        asis, run = path.copy(), at[first:last]
        asis[run] = 0
        turned = np.ptp(np.unwrap(angle)[max(first - 1, 0):last + 1])
        if turned < TURNED or cost_of(asis) - cost_of(path) < CALMER or away[run, path[run]].max() < APART:
            path = asis
    return path


def turn_arm(chain: Chain, t: int, side: int, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """(2, 3, 3) rotations of shoulder and elbow whose bones point along upper (3,) and lower (3,), camera frame; the elbow bends as
    a hinge."""
    arm, sign = ARM_JOINTS[side], 1 - 2 * side
    upper, lower = upper / np.linalg.norm(upper), lower / np.linalg.norm(lower)
    off = lower - (lower @ upper) * upper
    if np.linalg.norm(off) < STRAIGHT:
        off = chain.world[t, arm[1]][:, 2] - (chain.world[t, arm[1]][:, 2] @ upper) * upper
    front = off / np.linalg.norm(off)
    across = np.stack([sign * upper, np.cross(front, sign * upper), front], 1)
    end = np.stack([sign * lower, across[:, 1], np.cross(sign * lower, across[:, 1])], 1)
    return np.stack([chain.world[t, arm[0]].T @ across, across.T @ end])
