"""Limits of the gaussians that a bent joint would spread: many, small, flat and near their place on faces that grow there.

A face of an armpit, an elbow or a knee grows up to twice as the joint bends, and what it carries grows and moves away with it. A
clip of a turning person bends no joint, so its frames let such gaussians become long, tilted and displaced: wisps, once the arm is
raised. So these are limited from the first step on, by the bends that `BENDS` samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.joints import turn_joints
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.gaussians.bends import BENDS, usual_pose
from gsac.stages.train.poses.poses import Poses

TIED_FROM = 1.08
"""Growth of a face from which on its gaussians are tied."""
TIE = 0.005
"""m at rest that a tied gaussian may move away from its start."""
SPREAD = 0.006
"""m by which a bend may lengthen a gaussian's longest axis, a standard deviation."""
LEAST_SHARE = 0.3
"""Of the longest axis that is allowed elsewhere, what every face allows: fewer gaussians leave no gaps."""
MOST_DENSE = 4.0
"""Most gaussians on an area that grows, over those elsewhere: as many as keep it covered in the bend."""


class JointLimits(NamedTuple):
    """What gaussians are limited to, each by its face."""

    longest: np.ndarray
    """(F,) m at rest, of the longest axis."""
    tied: np.ndarray
    """(F,) bool: flat on the face, within `TIE` m of their start."""


def find_growth(poses: Poses, frames: np.ndarray) -> np.ndarray:
    """(F,) float64, by how much each face grows in the bend that makes it largest, 1 at least, from the usual pose of the fit.

    frames: (n,) trained ones.
    """
    body, (rest, joints) = poses.body, poses.rest(int(frames[0]))
    usual = usual_pose(poses.fit_pose, frames)

    def sizes(pose: np.ndarray, _: Workspace) -> np.ndarray:
        return face_frames(body.bend(rest, joints, pose), body.faces).k

    as_usual, *bent = side_by_side(sizes, [usual, *(turn_joints(usual, turns) for turns in BENDS)])
    return np.maximum(np.max(bent, 0).astype(np.float64) / np.maximum(as_usual, 1e-9), 1)


def density_where_grown(growth: np.ndarray) -> np.ndarray:
    """(F,) factors of the density of gaussians. growth: (F,) of `find_growth`."""
    return np.minimum(growth**2, MOST_DENSE)


def limit_where_grown(growth: np.ndarray, longest: float) -> JointLimits:
    """growth: (F,) of `find_growth`; longest: m, the longest axis that faces which do not grow allow."""
    by_growth = SPREAD / np.maximum(growth - 1, 1e-6)
    return JointLimits(np.clip(by_growth, LEAST_SHARE * longest, longest), growth > TIED_FROM)


def limit_nowhere(faces: int, longest: float) -> JointLimits:
    """Of so many faces none grows."""
    return JointLimits(np.full(faces, longest), np.zeros(faces, bool))
