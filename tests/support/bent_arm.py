"""A turning person whose left arm is bent for some frames, with the problem of the fit and the true state."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.joints import INDEX
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.lm.fit import set_up
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, HiddenArms
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.state import State
from support.turning_person import height_of, outlines_of, sightings_of, turning_person

HAIR = ((0, -40, 40), (0, -125, 0))
"""Rotation vectors, degrees, of the left shoulder and elbow."""


def person_with(body: Body, folder: Path, pose: tuple, turn: np.ndarray, bent: range) -> tuple[HiddenArms, Problem, State]:
    """Arms, problem and true state of a person whose left arm has the pose in some frames. turn: (T,) rad."""
    frames, arm = len(turn), ARM_JOINTS[0, 1:3] - 1
    truth = turning_person(body, frames)
    truth.global_orient = (Rotation.from_euler("x", np.pi) * Rotation.from_euler("y", turn[:, None])).as_rotvec().astype(np.float32)
    own = truth.body_pose.reshape(frames, 21, 3).copy()
    own[np.ix_(bent, arm)] = np.radians(np.array(pose, float))
    truth.body_pose = own.reshape(frames, 63)
    seen = sightings_of(body, truth)
    problem, state, _ = set_up(body, seen, outlines_of(body, truth, folder), Detector.load(seen.detector, body),
                               SmplxConfig(height_m=height_of(body, truth)))
    local = rotation.exp(truth.pose.reshape(frames, 55, 3).astype(float))
    return HiddenArms.of(body, seen.person_height), problem, replace(state, local=local, transl=truth.transl.astype(float),
                                                                     betas=truth.betas.astype(float))


def with_left_arm(state: State, pose: np.ndarray) -> State:
    """The state with the left arm's shoulder, elbow and wrist so in all frames. pose: (3, 3, 3) rotations."""
    out = replace(state, local=state.local.copy())
    out.local[:, ARM_JOINTS[0, 1:]] = pose
    return out


def distances(problem: Problem, truth: State, local: np.ndarray, joint: str) -> np.ndarray:
    """(T,) m of a joint from the true one, by joint rotations (T, J, 3, 3) alone."""
    place = [problem.skeleton.pose(of, truth.shape).place[:, INDEX[joint]] for of in (truth.local, local)]
    return np.linalg.norm(place[0] - place[1], axis=1)
