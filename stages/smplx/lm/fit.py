"""The Levenberg-Marquardt fit of one clip.

1. Start in closed form (initial.py), or from the poses that the user brought (start/); only root and place move.
2. All joints, by the key points alone.
3. Rounds that renew the outline points, learn the spreads of the stance, and put the feet on a ground.
4. Fingers, on the fitted wrists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.wholebody import LEFT_HAND, RIGHT_HAND
from gsac.avatar.yaw import yaw
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.jacobians import make_pairs, place_points
from gsac.stages.smplx.lm.doubtful_arms import find_contradicted, find_untold, measure_uncovered, move, settle_doubtful
from gsac.stages.smplx.lm.ground import Ground
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, FREE, QUICK, HiddenArms, widen_arm
from gsac.stages.smplx.lm.hidden_search import search_hidden
from gsac.stages.smplx.lm.observations import observe, subtract_habit
from gsac.stages.smplx.lm.outline_points import meet_outlines
from gsac.stages.smplx.lm.person_offsets import PersonOffsets
from gsac.stages.smplx.lm.problem import ROBUST, Problem, estimate_joint_sigma
from gsac.stages.smplx.lm.resting_arms import rest_arms
from gsac.stages.smplx.lm.shake import transl_acceleration
from gsac.stages.smplx.lm.swapped_sides import DEARER, MARGIN, believe_by_faces, propose_by_faces, propose_swapped
from gsac.stages.smplx.lm.turn_jumps import find_jumps, find_turned_over
from gsac.stages.smplx.lm.unseen_sway import find_unseen_sway
from gsac.stages.smplx.prior import BODY_JOINTS, FINGER_JOINTS
from gsac.stages.smplx.sightings import BODY_POINTS, HIPS, Sightings, focal_prior
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.start.begin import begin
from gsac.stages.smplx.state import Fit, State

FINGER_POINTS = np.array([i for hand in (LEFT_HAND, RIGHT_HAND) for i in range(hand.start, hand.stop)])
SCALE_BONES = ((5, 11), (6, 12), (11, 13), (12, 14), (5, 7), (6, 8))
"""Pairs of key points: trunk, thighs and upper arms."""
FAR_OFF = 5.0
"""Factor on the robust limit before the outline counts: an arm that starts hanging has a long way to go."""
ROUNDS_DEPTH_SPREAD = 0.8
"""m, of the detector's depth in the rounds, once limbs point the right way: its depth leans with the camera, the images do not."""
FOLLOWED = 0.6
"""Share of the usual IoU below which the body does not follow a frame: where hands hide 0.85 and more, in a skirt 0.8, of a person
who has left 0.4 at most."""
TRUNK_STEPS = 4
"""Steps in which only the root and the place move."""
VIEW = np.radians(30)
"""Width of a bin of yaw; frames of one bin show one view of the person."""


def fit_clip(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
             progress: Callable[[int, int, str], None], arms_told: bool = True) -> Fit:
    """Fits all frames at once. T may be 1; temporal terms need 3 frames and timestamps.

    arms_told: whether the pictures tell one pose of an arm from another; else arms that are hidden or in doubt are named, but stay
    where they are.
    """
    detector = Detector.load(sightings.detector, body)
    sightings, problem, state, steps, said = fit_either_side(body, sightings, outlines, detector, config)
    hidden = HiddenArms.of(body, sightings.person_height)
    moved = rested = np.zeros((len(sightings.xy), 2), bool)
    if arms_told:
        state, moved, rested = move_contradicted(hidden, problem, state, sightings.missing)
    problem.outline_weight = config.silhouette
    if sightings.missing is not None and sightings.missing.any():
        hidden.find(problem, state, sightings.missing, find_followed(problem, state))
        state = search_hidden(hidden, problem, state, sightings.missing) if arms_told else state
    iou = np.full(len(sightings.xy), np.nan)
    problem.limit, problem.seen.depth_spread = ROBUST, ROUNDS_DEPTH_SPREAD
    for r in range(config.rounds):
        progress(r, config.rounds + 1, "rounds")
        subtract_habit(problem.seen, sightings, detector, BODY_POINTS, state)
        if config.silhouette > 0:
            problem.outline_pairs, iou = meet_outlines(problem, state)
        hidden.hold(problem, state)
        state.stance = problem.stance.learn(state.local[:, problem.active], state.stance)
        if problem.ground is None and config.contact > 0:
            stand_on_ground(problem, state, sightings, config.contact)
        state, more = problem.minimise(state, config.iterations)
        steps += more
    cost = problem.cost(state)
    state, doubtful = settle_doubtful(hidden, problem, state, sightings.missing, rested, movable=arms_told)
    doubtful |= moved & ~hidden.mark(len(moved))
    state, more = fit_fingers(sightings, detector, problem, state, config)
    progress(config.rounds + 1, config.rounds + 1, "rounds")
    sigma = estimate_joint_sigma(problem, state)
    hidden.widen(sigma)
    for side in (0, 1):
        widen_arm(sigma, side, doubtful[:, [side]])
    chain = problem.skeleton.pose(state.local, state.shape)
    said += find_unseen_sway(state.local[:, 0], chain.place + state.transl[:, None])
    return Fit(state, sigma, iou, measure_reprojection(problem, state), steps + more,
               problem.person_offsets.joint_offset(state.own), tuple(said),
               {Code.HAND_HIDDEN: hidden.mark(len(sigma)), Code.ARM_DOUBTFUL: doubtful}, cost,
               measure_uncovered(hidden, problem, state, np.arange(len(sigma))))


def fit_either_side(body: Body, sightings: Sightings, outlines: list[Outline], detector: Detector,
                    config: SmplxConfig) -> tuple[Sightings, Problem, State, int, list[Finding]]:
    """Fits the key points, with left and right exchanged in the frames that the turn accuses if that costs much less, or in those
    that the faces accuse, too, if it hardly costs more.

    Returns the sightings that were fitted, problem, state, number of steps and what the user should know.
    """
    asis = best = Try.of(body, sightings, outlines, detector, config)
    if (exchanged := propose_swapped(sightings)).any():
        other = Try.of(body, sightings.exchange_sides(exchanged), outlines, detector, config)
        best = other if other.cost() < asis.cost() - MARGIN * exchanged.sum() else asis
    if best is asis and (exchanged := propose_by_faces(sightings)).any():
        other = Try.of(body, sightings.exchange_sides(exchanged), outlines, detector, config, exchanged)
        best = other if other.cost() < asis.cost(exchanged) + DEARER * exchanged.sum() else asis
    said = [*best.said, *([] if best is asis else [Finding.of(Code.SIDES_EXCHANGED, exchanged)])]
    if best.problem.jumps.any():
        said.append(Finding.of(Code.TURN_JUMPS, np.pad(best.problem.jumps, 1)))
    over = find_turned_over(best.state.local[:, 0], sightings.seconds) & ~believe_by_faces(best.sightings)
    if over.any():
        said.append(Finding.of(Code.TURNED_OVER, over, figure=over.sum()))
    return best.sightings, best.problem, best.state, best.steps, said


@dataclass(frozen=True)
class Try:
    """The key points fitted, with the sides as they are or exchanged."""

    sightings: Sightings
    problem: Problem
    state: State
    steps: int
    said: tuple[Finding, ...]

    @classmethod
    def of(cls, body: Body, sightings: Sightings, outlines: list[Outline], detector: Detector, config: SmplxConfig,
           flat: np.ndarray | None = None) -> Try:
        """flat: (T,) bool, frames whose depths do not count; None: none."""
        problem, state, said = set_up(body, sightings, outlines, detector, config)
        if flat is not None:
            problem.seen.depth[flat] = np.nan
        return cls(sightings, problem, *fit_points(problem, state, sightings, detector, 3 * config.iterations), said)

    def cost(self, flat: np.ndarray | None = None) -> float:
        """flat: (T,) bool, frames whose depths do not count; None: none."""
        seen, depth = self.problem.seen, self.problem.seen.depth
        if flat is not None:
            seen.depth = np.where(flat[:, None], np.nan, depth)
        cost, seen.depth = self.problem.cost(self.state), depth
        return cost


def set_up(body: Body, sightings: Sightings, outlines: list[Outline], detector: Detector,
           config: SmplxConfig) -> tuple[Problem, State, tuple[Finding, ...]]:
    """The problem of the body's joints, the state from which it is solved, and what the user should know of that."""
    center, focal = sightings.center, focal_prior(sightings, config)
    person_offsets = PersonOffsets.of(body, detector.own, config.joint_offsets)
    moves = np.concatenate([detector.slopes(body), person_offsets.points], 2)
    pairs = make_pairs(body, body.keypoint_matrix[BODY_POINTS], detector.offsets[BODY_POINTS], moves[BODY_POINTS])
    seen = observe(sightings, detector, BODY_POINTS, center, focal, config, outlines)
    problem = Problem(body, pairs, HIPS, seen, BODY_JOINTS, config.smoothness, person_offsets)
    problem.transl_spread = transl_acceleration(sightings)
    start, said = begin(body, sightings, focal[0], center)
    state = replace(start, own=np.zeros(len(person_offsets.spread)))
    if sightings.seconds is not None:
        problem.jumps = find_jumps(state.local[:, 0])
    seen.depth *= measure_world_scale(problem, state, sightings)
    seen.repeats = count_repeats(state.local[:, 0])
    return problem, state, said


def fit_points(problem: Problem, state: State, sightings: Sightings, detector: Detector, iterations: int) -> tuple[State, int]:
    """Fits the key points alone, first by root and place. Returns state and number of steps."""
    problem.limit = FAR_OFF * ROBUST
    bends = np.zeros(problem.size, bool)
    bends[3:-3] = True
    subtract_habit(problem.seen, sightings, detector, BODY_POINTS, state)
    state, first = problem.minimise(state, TRUNK_STEPS, bends, np.ones(state.shared, bool))
    subtract_habit(problem.seen, sightings, detector, BODY_POINTS, state)
    state, more = problem.minimise(state, iterations)
    return state, first + more


def move_contradicted(arms: HiddenArms, problem: Problem, state: State,
                      missing: np.ndarray | None) -> tuple[State, np.ndarray, np.ndarray]:
    """The state with arms that the pictures contradict where they clearly are, before they drag the trunk along; (T, 2) bool,
    those that moved, as quickly as a gesture from then on; and (T, 2) bool, those that rest.

    missing: (T, 2) bool, hands that were not detected; None: all were.
    """
    missing = np.zeros((len(state.local), 2), bool) if missing is None else missing.astype(bool)
    contradicted = find_contradicted(arms, problem, state, missing)
    state, rested = rest_arms(arms, problem, state, contradicted | find_untold(arms, problem, state, missing), missing)
    if rested.any():  # the trunk and the other arm have moved, too
        contradicted = find_contradicted(arms, problem, state, missing)
    moved = contradicted & ~rested
    settled = move(arms, problem, state, moved, missing)
    moved &= (settled.local != state.local)[:, ARM_JOINTS].any((2, 3, 4))
    for side in (0, 1):
        arm = np.ix_(moved[:, side], np.isin(problem.active, ARM_JOINTS[side]))
        problem.loose[arm] = QUICK
        problem.spread[arm] *= FREE
    return settled, moved, rested


def stand_on_ground(problem: Problem, state: State, sightings: Sightings, weight: float) -> None:
    """Adds the ground's terms to the problem, and the ground's height to the state."""
    problem.ground = Ground(problem.body, weight)
    problem.ground.find_resting_feet(sightings.xy, sightings.seen, sightings.seconds, sightings.person_height)
    chain = problem.skeleton.pose(state.local, state.shape)
    state.level = problem.ground.estimate_level(chain, state.shape, state.transl, state.stance)


def count_repeats(turns: np.ndarray) -> float:
    """Mean number of frames that show one view. turns: (T, 3, 3) of the body to the camera frame."""
    return len(turns) / len(np.unique(np.floor(yaw(turns) / VIEW)))


def measure_world_scale(problem: Problem, state: State, sightings: Sightings) -> float:
    """Ratio of the body's bones to those of the detector's metric points, its median over `SCALE_BONES`."""
    chain = problem.skeleton.pose(state.local[:1], state.shape)
    x = place_points(chain, problem.pairs, state.shape)[0]
    ratios = []
    for a, b in SCALE_BONES:
        length = np.linalg.norm(sightings.world[:, a] - sightings.world[:, b], axis=-1)
        if np.isfinite(length).any():
            ratios.append(np.linalg.norm(x[a] - x[b]) / np.nanmedian(length))
    return float(np.median(ratios)) if ratios else 1.0


def find_followed(problem: Problem, state: State) -> np.ndarray:
    """(T,) bool, frames whose points and mask the body follows: others, after the person has left, say, tell of no hand."""
    _, iou = meet_outlines(problem, state)
    known = iou[np.isfinite(iou)]
    far = iou < FOLLOWED * np.median(known) if len(known) else np.zeros(len(iou), bool)
    return np.isfinite(problem.seen.spread).any(1) & ~far


def fit_fingers(sightings: Sightings, detector: Detector, problem: Problem, state: State, config: SmplxConfig) -> tuple[State, int]:
    """Bends the fingers on the fitted wrists; nothing else moves. Returns state and number of steps."""
    body = problem.body
    pairs = make_pairs(body, body.keypoint_matrix[FINGER_POINTS], detector.offsets[FINGER_POINTS])
    seen = observe(sightings, detector, FINGER_POINTS, problem.seen.center, problem.seen.focal_prior, config, [])
    fingers = Problem(body, pairs, (0, 0), seen, FINGER_JOINTS, config.smoothness, problem.person_offsets)
    state = replace(state, local=state.local.copy(), stance=np.zeros(0), level=np.zeros(0))
    state.local[:, FINGER_JOINTS] = rotation.exp(fingers.mean)
    place = np.arange(fingers.size) >= fingers.size - 3
    return fingers.minimise(state, config.iterations, place, np.ones(state.shared, bool))


def measure_reprojection(problem: Problem, state: State) -> np.ndarray:
    """(T,) median distance, px, of seen and fitted body points; NaN where nothing was seen."""
    out = np.full(len(state.local), np.nan)
    for t, x in enumerate(problem.locate_points(problem.skeleton.pose(state.local, state.shape), state)):
        off = np.linalg.norm(problem.project(state, x) - problem.seen.xy[t], axis=-1)[np.isfinite(problem.seen.spread[t])]
        out[t] = np.median(off) if len(off) else np.nan
    return out
