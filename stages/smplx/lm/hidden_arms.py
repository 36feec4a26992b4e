"""Arms whose hand goes where the camera does not see it: behind the back, or before the belly of a person who faces away.

Points alone leave open whether a forearm goes to the front or to the back, and a hand that is not detected leaves even more. But a
hand that lies before the trunk, or beside the body outside the mask, would be seen. Where the fit, or the arm as it usually is, has
it there for several frames, the hand hides: skin outside the mask costs, and the wrist belongs behind the trunk, or to the place on
it that was found (hidden_search.py). Where the arm may be as usual, the far arm of a side view, nothing hides; points that say
otherwise are made up.
T frames, P points, A active joints; sides are 0 left, 1 right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.joints import INDEX, LEFT_HAND, RIGHT_HAND, J
from gsac.avatar.wholebody import INDEX as POINT
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.jacobians import Chain, Pairs, make_surface_pairs, place_points
from gsac.stages.smplx.lm.problem import ROBUST, Problem
from gsac.stages.smplx.sightings import BODY_POINTS
from gsac.stages.smplx.state import State

SIDES = ("left", "right")
HANDS = (LEFT_HAND, RIGHT_HAND)
ARM_JOINTS = np.array([[INDEX[f"{side}_{name}"] for name in ("collar", "shoulder", "elbow", "wrist")] for side in SIDES])
TRUNK_JOINTS = [INDEX[name] for name in ("pelvis", "spine1", "spine2", "spine3")]
ELBOW, WRIST = ([int(np.flatnonzero(POINT[f"{side}_{name}"] == BODY_POINTS)[0]) for side in SIDES] for name in ("elbow", "wrist"))
HAND = [np.flatnonzero((first <= BODY_POINTS) & (first + 21 > BODY_POINTS)) for first in (91, 112)]
"""Rows of `BODY_POINTS`."""
ARM_SAMPLES, TRUNK_SAMPLES = 48, 500
"""Points of the surface of a forearm with its hand, and of the trunk, at most."""
OVER = 0.06
"""m, sideways, within which points of the trunk lie on a wrist's line of sight."""
BEFORE = 0.02
"""m before the trunk's near surface from which on a wrist is in plain view."""
SKIN, BEHIND_SPREAD = 0.03, 0.05
"""m: a hidden wrist's depth behind the trunk's far surface, and its spread."""
OUTSIDE, OUTSIDE_SHARE, OUTSIDE_COUNTS = 0.01, 0.1, 0.5
"""An arm is outside the mask if the second, a share of its points, lies farther out than the first, a share of the person's height;
then it counts so much of a frame with the hand before the trunk: masks miss arms. On three turns and a real one at most 0.09 of an
arm that the body covers lies outside."""
HANGS = 0.4
"""Share of an arm as it usually is that would be seen, in the mean of frames in which its hand is not: below it, the arm may just
hang there. Of far arms in clean turns at most 0.29, with a hand on the back 0.56 on."""
NEAR, MOSTLY = np.radians(20), 0.6
"""An arm mostly rests if shoulder and elbow lie so near their medians in more than this share of frames that show its hand: 0.63 on
where a right hand goes to the back, 0.47 at most where hands talk, 0.29 where arms are crossed."""
FACES = 0.4
"""Share of a trunk's front or back that looks along the view, at least, where it tells how deep a hand on it lies."""
LEAST_S = 0.25
"""Time in plain view, at least, that contradicts a hand which was not detected; one frame where frames are farther apart."""
TRUSTED = 0.6
"""Share of frames with the hand beside the trunk in which it must be detected: a detector that misses it there proves nothing."""
BRIDGED = 2
"""Frames between two stays that belong to them."""
AROUND_S = 1.2
"""Seconds before and after in which the arm is searched again too: it comes and goes."""
QUICK, STILL, FREE = 4.0, 0.15, 2.0
"""Factors on the spreads of the arm's speed and acceleration there, and while the hand is out of sight, where it rests; and on that
of its pose."""
ROUGH_DEPTH = 0.2
"""m, spread of the detector's depths of the arm there: it mistakes a hand behind the back for one before the belly."""
FAR_OFF = 5.0
"""Factor on the robust limit in the search."""
STEPS = 12
"""Steps of each search, at most."""
SIGMA = {"elbow": 0.05, "wrist": 0.1}
"""m, added to the standard deviation of a hidden arm's joints; a hand's joints have the wrist's."""


@dataclass
class Stay:
    """A hand out of sight from `first` to `last`, exclusive; the arm is searched again from `start` to `stop`, exclusive."""

    side: int
    first: int
    last: int
    start: int
    stop: int
    usual: np.ndarray | None = None
    """(4, 3, 3) rotations of the arm, which mostly rests wherever its hand is seen; None where it does not."""
    rests: bool = True
    """Whether the arm rests while the hand is out of sight."""
    on_back: bool = False
    """Whether it rests on the person's back; else anywhere behind the trunk as the camera sees it."""
    wider: tuple[int, int] | None = None
    """First and last frame, exclusive, of the rest, where it began before the hand was lost or went on after; None: the stay's."""

    @property
    def around(self) -> slice:
        """The frames that are searched again."""
        return slice(self.start, self.stop)

    @property
    def held(self) -> tuple[int, int]:
        """First and last frame, exclusive, in which the hand lies where it hides."""
        return self.wider or (self.first, self.last)

    @property
    def resting(self) -> slice:
        """Those frames but the first and the last, to and from which the arm goes."""
        return slice(self.held[0] + 1, self.held[1] - 1)

    def shift(self, by: int, frames: int) -> Stay:
        """The same in frames of a window that begins so many later and has so many."""
        ends = np.array([self.first, self.last, self.start, self.stop, *self.held])
        first, last, start, stop, *held = np.clip(ends - by, 0, frames).tolist()
        return replace(self, first=first, last=last, start=start, stop=stop, wider=(held[0], held[1]))


@dataclass
class HiddenArms:
    """The term of one clip's hidden arms; no stays where every hand lies where it can."""

    trunk: Pairs
    forearm: tuple[Pairs, Pairs]
    """With the hand, left and right."""
    height: float
    """px, of the person."""
    stays: list[Stay]

    @classmethod
    def of(cls, body: Body, height: float) -> HiddenArms:
        """The surfaces, and no stays yet. height: px, of the person."""
        weights = np.asarray(body.weights)
        left, right = (sample_surface(body, weights[:, arm[2:]].sum(1) > 0.5, ARM_SAMPLES) for arm in ARM_JOINTS)
        return cls(sample_surface(body, weights[:, TRUNK_JOINTS].sum(1) > 0.8, TRUNK_SAMPLES), (left, right), height, [])

    def find(self, problem: Problem, state: State, missing: np.ndarray, followed: np.ndarray) -> None:
        """Finds the stays: hands that were not detected where the fit, or the arm as it usually is, has them in plain view. Where
        only the fit has, its wrists are made up and do not count.

        missing: (T, 2) bool, hands that were not detected; followed: (T,) bool, frames that tell of a hand by its absence.
        """
        seconds = problem.seen.seconds
        if seconds is None:
            return
        chain = problem.skeleton.pose(state.local, state.shape)
        least = max(1.0, LEAST_S / float(np.median(np.diff(seconds)))) if len(seconds) > 1 else np.inf
        for side in (0, 1):
            found = []
            usual = find_usual(state.local[~missing[:, side].astype(bool)][:, ARM_JOINTS[side]])
            absent = missing[:, side].astype(bool) & followed
            for first, last in bridge(absent):
                lost = first + np.flatnonzero(absent[first:last])
                if len(lost) < least:
                    continue
                against = sum(self.contradict(problem, state, chain.frame(t), t, side) for t in lost.tolist())
                told, hangs = against >= least, False
                if usual is not None:
                    away = self.measure_away(problem, state, lost, side, usual)
                    hangs, told = bool(away.mean() < HANGS), told or OUTSIDE_COUNTS * away.sum() >= least
                if hangs and against >= least:
                    problem.seen.spread[lost, WRIST[side]] = np.inf
                elif told and not hangs:
                    found.append(Stay(side, first, last, *find_around(seconds, first, last), usual))
            if found and self.is_detected(state, chain, missing[:, side], side):
                self.stays += found

    def is_detected(self, state: State, chain: Chain, missing: np.ndarray, side: int) -> bool:
        """Whether the detector mostly finds this hand where nothing of the body can hide it. missing: (T,) bool."""
        wrist = chain.place[:, ARM_JOINTS[side, 3]] + state.transl
        beside = [np.isinf(self.measure_trunk(state, chain.frame(t), t, wrist[t])[0]) for t in range(len(missing))]
        return not any(beside) or bool((~missing[beside]).mean() > TRUSTED)

    def contradict(self, problem: Problem, state: State, chain: Chain, t: int, side: int) -> float:
        """How much it contradicts the fit that the hand is not detected: 1 where it lies before the trunk, less where the arm is
        outside the mask, else 0. chain: of frame t alone."""
        if self.is_before(state, chain, t, side):
            return 1.0
        return OUTSIDE_COUNTS if self.measure_outside(problem, state, chain, t, side) > OUTSIDE_SHARE else 0.0

    def is_before(self, state: State, chain: Chain, t: int, side: int) -> bool:
        """Whether the wrist lies before the trunk. chain: of frame t alone."""
        wrist = chain.place[0, ARM_JOINTS[side, 3]] + state.transl[t]
        return bool(wrist[2] < self.measure_trunk(state, chain, t, wrist)[0] - BEFORE)

    def measure_outside(self, problem: Problem, state: State, chain: Chain, t: int, side: int) -> float:
        """Share of forearm and hand that lies outside the mask; 0 without one. chain: of frame t alone."""
        x = place_points(chain, self.forearm[side], state.shape)[0] + state.transl[t]
        distance, _, inside = problem.seen.outlines[t].at(problem.project(state, x))
        return float((inside & (distance > OUTSIDE * self.height)).mean()) if problem.seen.outlines[t].area > 0 else 0.0

    def measure_away(self, problem: Problem, state: State, frames: np.ndarray, side: int, usual: np.ndarray) -> np.ndarray:
        """(F,) shares of an arm that would be seen if it were as usual: outside the mask, or with the hand before the trunk.

        frames: (F,), in which the hand is not detected; usual: (4, 3, 3) rotations of the arm's joints.
        """
        local = state.local[frames]
        local[:, ARM_JOINTS[side]] = usual
        chain, away = problem.skeleton.pose(local, state.shape), []
        for i, t in enumerate(frames.tolist()):
            own = chain.frame(i)
            away.append(max(self.is_before(state, own, t, side), self.measure_outside(problem, state, own, t, side)))
        return np.array(away, float)

    def measure_trunk(self, state: State, chain: Chain, t: int, place: np.ndarray) -> tuple[float, float]:
        """Depths, m, of the trunk's near and far surface on the line of sight to a place (3,) m; -inf and nan where there is none.

        chain: of frame t alone.
        """
        x = place_points(chain, self.trunk, state.shape)[0] + state.transl[t]
        on = np.linalg.norm(x[:, :2] / x[:, 2:] - place[:2] / place[2], axis=1) * place[2] < OVER
        return (float(x[on, 2].min()), float(x[on, 2].max())) if on.any() else (-np.inf, np.nan)

    def cut(self, window: Stay) -> HiddenArms:
        """The same with the stays of a window's arm alone, in frames of the window."""
        own = [s.shift(window.start, window.stop - window.start) for s in self.stays if s.side == window.side]
        return replace(self, stays=own)

    def hold(self, problem: Problem, state: State) -> None:
        """Tells the problem where hidden arms lie: inside the mask, the wrist behind the trunk on its line of sight, or before it
        where it rests on what the camera sees of the trunk."""
        problem.inside = [(t, self.forearm[stay.side]) for stay in self.stays for t in range(stay.first, stay.last)
                          if problem.seen.outlines[t].area > 0]
        if not self.stays:
            return
        spread = np.broadcast_to(problem.seen.depth_spread, problem.seen.depth.shape).copy()
        chain = problem.skeleton.pose(state.local, state.shape)
        hips = problem.locate_points(chain, state)[:, list(problem.hips), 2].mean(1)
        for stay in self.stays:
            spread[stay.around, ELBOW[stay.side]] = spread[stay.around, WRIST[stay.side]] = ROUGH_DEPTH
            for t in range(*stay.held):
                own = chain.frame(t)
                wrist = own.place[0, ARM_JOINTS[stay.side, 3]] + state.transl[t]
                near, far = self.measure_trunk(state, own, t, wrist)
                away = -own.world[0, TRUNK_JOINTS[-1], 2, 2] if stay.on_back else 1.0
                depth = far + SKIN if away > 0 else near - SKIN
                problem.seen.depth[t, WRIST[stay.side]] = depth - hips[t] if abs(away) > FACES and np.isfinite(depth) else np.nan
                spread[t, WRIST[stay.side]] = BEHIND_SPREAD
        problem.seen.depth_spread = spread

    def widen(self, sigma: np.ndarray) -> None:
        """Adds to the standard deviations of hidden arms what nothing in their frames tells; less on the way there.

        sigma: (T, 55) m, changed in place.
        """
        for stay in self.stays:
            frame = np.arange(stay.start, stay.stop)
            before, after = stay.first - stay.start + 1, stay.stop - stay.last + 1
            share = np.minimum(1, np.minimum((frame - stay.start + 1) / before, (stay.stop - frame) / after))[:, None]
            widen_arm(sigma[stay.around], stay.side, share)

    def mark(self, frames: int) -> np.ndarray:
        """(T, 2) bool, frames with a hidden hand. frames: T."""
        out = np.zeros((frames, 2), bool)
        for stay in self.stays:
            out[stay.first:stay.last, stay.side] = True
        return out

    def mark_held(self, frames: int) -> np.ndarray:
        """(T, 2) bool, frames with a hidden hand, and those beside them in which its arm rests at the same place. frames: T."""
        out = np.zeros((frames, 2), bool)
        for stay in self.stays:
            out[slice(*stay.held), stay.side] = True
        return out

    def mark_searched(self, frames: int) -> np.ndarray:
        """(T, 2) bool, frames in which an arm rests on the back, or goes there from where it usually is. frames: T."""
        out = np.zeros((frames, 2), bool)
        for stay in self.stays:
            out[stay.around, stay.side] |= stay.on_back
        return out


def find_usual(rotations: np.ndarray) -> np.ndarray | None:
    """(4, 3, 3) rotations of an arm that mostly rests; None where it does not. rotations: (N, 4, 3, 3) of the arm's joints."""
    if not len(rotations):
        return None
    usual = find_median(rotations)
    trace = np.einsum("nkab,kab->nk", rotations[:, 1:3], usual[1:3])
    return usual if (np.arccos(np.clip((trace - 1) / 2, -1, 1)).max(1) < NEAR).mean() > MOSTLY else None


def find_median(rotations: np.ndarray) -> np.ndarray:
    """(A, 3, 3) medians of rotations (N, A, 3, 3)."""
    u, _, v = np.linalg.svd(np.median(rotations, 0))
    u[..., -1] *= np.linalg.det(u @ v)[..., None]
    return u @ v


def isolate_arm(problem: Problem, stay: Stay) -> Problem:
    """The problem of the stay's arm alone, in its frames, with a motion as quick as a gesture; all else keeps still."""
    around, seen = stay.around, problem.seen
    assert seen.seconds is not None  # without times there are no stays
    cut = replace(seen, xy=seen.xy[around], spread=seen.spread[around], depth=seen.depth[around].copy(),
                  depth_spread=np.broadcast_to(seen.depth_spread, seen.depth.shape)[around], seconds=seen.seconds[around],
                  outlines=seen.outlines[around])
    alone = Problem(problem.body, problem.pairs, problem.hips, cut, ARM_JOINTS[stay.side], problem.smoothness,
                    problem.person_offsets)
    alone.loose[:], alone.limit = QUICK, FAR_OFF * ROBUST
    alone.spread *= FREE
    return alone


def isolate_state(state: State, stay: Stay, start: np.ndarray) -> State:
    """The state of the stay's frames, of body and camera as they are. start: (F, J, 3, 3) joint rotations."""
    return State(start, state.transl[stay.around], state.betas, state.log_focal, np.zeros(0), state.own)


def bend_arm(alone: Problem, state: State, steps: int) -> State:
    """The state after so many steps in which only the problem's joints turn."""
    place = np.arange(alone.size) >= alone.size - 3
    return alone.minimise(state, steps, place, np.ones(state.shared, bool))[0]


def find_around(seconds: np.ndarray, first: int, last: int) -> tuple[int, int]:
    """First and last frame, exclusive, within `AROUND_S` of frames, `last` exclusive. seconds: (T,)."""
    near = np.flatnonzero((seconds > seconds[first] - AROUND_S) & (seconds < seconds[last - 1] + AROUND_S))
    return int(near[0]), int(near[-1]) + 1


def describe_arms(arms: dict[Code, np.ndarray], fitted: np.ndarray) -> list[Finding]:
    """A finding for each side that has frames. arms: code -> (T, 2) bool; fitted: (T,) bool: of others nothing is said."""
    found = [(code, side, own & fitted) for code, both in arms.items() for side, own in zip(SIDES, both.T, strict=True)]
    return [Finding.of(code, own, figure=own.sum(), side=side) for code, side, own in found if own.any()]


def widen_arm(sigma: np.ndarray, side: int, share: np.ndarray) -> None:
    """Adds a share (T, 1) of `SIGMA` to the standard deviations of an arm. sigma: (T, 55) m, changed in place."""
    for name, more in SIGMA.items():
        own = [INDEX[f"{SIDES[side]}_{name}"], *(np.arange(J)[HANDS[side]] if name == "wrist" else ())]
        sigma[:, own] = np.hypot(sigma[:, own], more * share)


def sample_surface(body: Body, part: np.ndarray, most: int) -> Pairs:
    """Middles of faces, spread over a part of the surface, at most so many. part: (V,) bool."""
    face = np.flatnonzero(part[body.faces].all(1))
    face = face[:: -(-len(face) // most)]
    return make_surface_pairs(body, face, np.full((len(face), 3), 1 / 3))


def bridge(missing: np.ndarray, bridged: int = BRIDGED) -> list[tuple[int, int]]:
    """First and last frame, exclusive, of each run of missing (T,) bool; gaps of up to so many frames are part of it."""
    index = np.flatnonzero(missing)
    parts = np.split(index, np.flatnonzero(np.diff(index) > bridged + 1) + 1)
    return [(int(part[0]), int(part[-1]) + 1) for part in parts if len(part)]
