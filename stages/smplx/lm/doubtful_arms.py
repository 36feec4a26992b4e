"""Arms that the pictures contradict for some frames: a hand on the hip, in a pocket, at the head, or crossed arms.

A hand is not detected though the fitted one is in plain view, or for more of the turn than a trunk covers it; a forearm lies
outside the mask; seen points are far from fitted ones. T frames; sides are 0 left, 1 right.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.yaw import yaw
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.stages.smplx.jacobians import place_points
from gsac.stages.smplx.lm.hidden_arms import ELBOW, HAND, WRIST, HiddenArms, bridge
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.state import State, to_params

PLAIN, NEARER, OUTSIDE, MOST = 0.25, 0.03, 0.2, 0.5
"""Share of an arm from which on it is in plain view, m of skin before it; share outside the mask, 0.02 at most in three turns of 60
frames; share of a hand's points that are far."""
FAR, LEAST, LEAST_S = 4.5, 3, 0.4
"""Spreads to a seen point, 3.4 at most in three turns; frames and seconds at least: hands in plain view are missed for 0.13 s."""
ARC, DETECTED = np.radians(90), 0.6
"""Turn without a hand, 51 degrees at most in four turns; share of other frames with it: bad detectors prove nothing."""


def find_doubtful(arms: HiddenArms, problem: Problem, state: State, missing: np.ndarray | None) -> np.ndarray:
    """(T, 2) bool, doubtful arms that `arms` does not have for hidden. missing: (T, 2) bool, undetected hands; None: none."""
    seen, seconds, turn = problem.seen, problem.seen.seconds, yaw(state.local[:, 0])
    least = max(LEAST, LEAST_S / float(np.median(np.diff(seconds)))) if seconds is not None and len(seconds) > 1 else LEAST
    chain = problem.skeleton.pose(state.local, state.shape)
    uv = problem.project(state, problem.locate_points(chain, state))
    far = np.linalg.norm(np.where(np.isfinite(seen.spread)[..., None], uv - seen.xy, 0), axis=-1) > FAR * seen.spread
    out, missing = np.zeros((len(turn), 2), bool), np.zeros((len(turn), 2), bool) if missing is None else missing
    for side in (0, 1):
        against = far[:, [ELBOW[side], WRIST[side]]].any(1) | (far[:, HAND[side]].mean(1) > MOST)
        against |= [arms.measure_outside(problem, state, chain.frame(t), t, side) > OUTSIDE for t in range(len(turn))]
        for first, last in bridge(against):
            out[first:last, side] |= against[first:last].sum() >= least
        runs = [run for run in bridge(missing[:, side]) if run[1] - run[0] >= least]
        plain = find_plain(arms, problem, state, side) if runs else against
        for first, last in runs:
            lost, elsewhere = (plain & missing[:, side])[first:last].sum(), plain.copy()
            elsewhere[first:last] = False
            others = missing[elsewhere, side]
            contradicted = lost >= least or np.ptp(np.unwrap(turn[first:last])) > ARC
            out[first:last, side] |= contradicted and len(others) >= LEAST and 1 - others.mean() > DETECTED
    for stay in arms.stays:
        out[stay.first:stay.last, stay.side] = False
    return out


def find_plain(arms: HiddenArms, problem: Problem, state: State, side: int) -> np.ndarray:
    """(T,) bool, frames in which the fitted hand with its forearm is in plain view."""
    body, scale, (h, w) = problem.body, problem.seen.outlines[0].scale, problem.seen.outlines[0].field.shape
    params = to_params(body, state, problem.seen.center, joint_offset=problem.person_offsets.joint_offset(state.own))
    camera = params.camera(round(w * scale), round(h * scale)).scaled(w, h)
    x = place_points(problem.skeleton.pose(state.local, state.shape), arms.forearm[side], state.shape) + state.transl[:, None]
    depths = (rasterise(body.posed(params, [t])[0][0], body.faces, camera)[2] for t in range(len(x)))
    return np.array([visible_points(*pair, camera, NEARER).mean() > PLAIN for pair in zip(x, depths, strict=True)])
