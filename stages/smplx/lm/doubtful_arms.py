"""Arms that the pictures contradict: what is fitted is not what is seen, and nobody can say where the arm is.

A hand that is not detected although the fitted one is in plain view, or for more of the turn than a trunk covers it, a forearm whose
skin lies outside the mask, and points far from the fitted ones are evidence alike: of a hand on the hip, in a pocket, at the head, or
of crossed arms. One frame may err; some in a row do not.
T frames; sides are 0 left, 1 right.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import INDEX, J
from gsac.avatar.yaw import yaw
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.jacobians import place_points
from gsac.stages.smplx.lm.hidden_arms import ELBOW, HAND, HANDS, SIDES, SIGMA, WRIST, HiddenArms, bridge
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.state import State, to_params

PLAIN, NEARER = 0.25, 0.03
"""Share of a forearm with its hand that is in plain view, from which on a hand is detected; m that skin lies before it at most."""
OUTSIDE, OUTSIDE_SHARE = 0.01, 0.2
"""Share of the person's height outside the mask, and share of the arm there; of three turns in 60 frames at most 0.02 of an arm."""
FAR = 4.5
"""Spreads between a seen and a fitted point of the arm; 3.4 at most in three turns."""
MOST = 0.5
"""Share of the hand's points that are far."""
LEAST, LEAST_S = 3, 0.4
"""Frames, and seconds, that contradict, at least: in four turns a hand that hangs is missed in plain view for 0.13 s at most."""
ARC = np.radians(90)
"""Turn in which a hand is not detected, from which on no trunk covers it that long; 66 degrees at most in four turns."""
DETECTED = 0.6
"""Share of the other frames in plain view in which a hand must be detected: a detector that misses it there proves nothing."""


def find_doubtful(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray | None) -> np.ndarray:
    """(T, 2) bool, arms that contradict what is seen for some frames; hands that are known to be hidden are none.

    missing: (T, 2) bool, hands that were not detected; None: all were.
    """
    far, plain = find_far(problem, state), None
    turn, seconds = yaw(state.local[:, 0]), problem.seen.seconds
    apart = float(np.median(np.diff(seconds))) if seconds is not None and len(seconds) > 1 else LEAST_S
    least = max(LEAST, LEAST_S / apart)
    out = np.zeros_like(far)
    for side in (0, 1):
        against = far[:, side] | find_outside(arms, problem, state, side)
        for first, last in bridge(against):
            out[first:last, side] |= against[first:last].sum() >= least
        for first, last in [] if missing is None else bridge(missing[:, side]):
            if last - first < least:
                continue
            plain = find_plain(arms, problem, state) if plain is None else plain
            lost, others = (plain & missing)[first:last, side].sum(), plain[:, side].copy()
            others[first:last] = False
            around = np.ptp(np.unwrap(turn[first:last]))
            if (lost >= least or around > ARC) and others.sum() >= LEAST and (~missing[others, side]).mean() > DETECTED:
                out[first:last, side] = True
    for stay in arms.stays:
        out[stay.first:stay.last, stay.side] = False
    return out


def find_outside(arms: HiddenArms, problem: Problem, state: State, side: int) -> np.ndarray:
    """(T,) bool, frames in which the skin of a forearm lies outside the mask."""
    chain = problem.skeleton.pose(state.local, state.shape)
    x = place_points(chain, arms.forearm[side], state.shape) + state.transl[:, None]
    out = np.zeros(len(x), bool)
    for t, outline in enumerate(problem.seen.outlines):
        distance, _, judged = outline.at(problem.project(state, x[t]))
        out[t] = outline.area > 0 and (judged & (distance > OUTSIDE * arms.height)).mean() > OUTSIDE_SHARE
    return out


def find_far(problem: Problem, state: State) -> np.ndarray:
    """(T, 2) bool, arms of which a seen point is far from the fitted one."""
    x = problem.locate_points(problem.skeleton.pose(state.local, state.shape), state)
    known = np.isfinite(problem.seen.spread)
    off = np.linalg.norm(problem.project(state, x) - np.nan_to_num(problem.seen.xy), axis=-1)
    far = known & (off > FAR * np.where(known, problem.seen.spread, 1))
    return np.stack([far[:, [ELBOW[side], WRIST[side]]].any(1) | (far[:, HAND[side]].mean(1) > MOST) for side in (0, 1)], 1)


def find_plain(arms: HiddenArms, problem: Problem, state: State) -> np.ndarray:
    """(T, 2) bool, fitted hands with their forearms in plain view."""
    body, outlines = problem.body, problem.seen.outlines
    out = np.zeros((len(state.local), 2), bool)
    if not outlines:
        return out
    (h, w), scale = outlines[0].field.shape, outlines[0].scale
    params = to_params(body, state, problem.seen.center, joint_offset=problem.person_offsets.joint_offset(state.own))
    camera = params.camera(round(w * scale), round(h * scale)).scaled(w, h)
    chain = problem.skeleton.pose(state.local, state.shape)
    x = [place_points(chain, pairs, state.shape) + state.transl[:, None] for pairs in arms.forearm]
    for t in range(len(out)):
        depth = rasterise(body.posed(params, [t])[0][0], body.faces, camera)[2]
        out[t] = [visible_points(x[side][t], depth, camera, NEARER).mean() > PLAIN for side in (0, 1)]
    return out


def widen_doubtful(sigma: np.ndarray, doubtful: np.ndarray) -> None:
    """Adds to the standard deviations of doubtful arms. sigma: (T, 55) m, changed in place; doubtful: (T, 2) bool."""
    for side in (0, 1):
        for name, more in SIGMA.items():
            own = [INDEX[f"{SIDES[side]}_{name}"], *(np.arange(J)[HANDS[side]] if name == "wrist" else ())]
            at = np.ix_(doubtful[:, side], own)
            sigma[at] = np.hypot(sigma[at], more)


def describe_doubtful(doubtful: np.ndarray) -> list[Finding]:
    """What the user should know. doubtful: (T, 2) bool."""
    return [Finding.of(Code.ARM_DOUBTFUL, doubtful[:, side], figure=doubtful[:, side].sum(), side=SIDES[side])
            for side in (0, 1) if doubtful[:, side].any()]
