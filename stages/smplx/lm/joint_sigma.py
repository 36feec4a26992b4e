"""sigma_joints of a fit by a method that knows none of its own."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.jacobians import make_pairs
from gsac.stages.smplx.lm.observations import observe
from gsac.stages.smplx.lm.problem import Problem, estimate_joint_sigma
from gsac.stages.smplx.prior import BODY_JOINTS
from gsac.stages.smplx.sightings import BODY_POINTS, HIPS, Sightings, focal_prior
from gsac.stages.smplx.state import State


def estimate_sigma(body: Body, sightings: Sightings, state: State, config: SmplxConfig, center: np.ndarray) -> np.ndarray:
    """sigma_joints (T, 55) m by the normal equations of `lm` at this state. center: (2,) px."""
    detector = Detector.load(sightings.detector, body)
    pairs = make_pairs(body, body.keypoint_matrix[BODY_POINTS], detector.offsets[BODY_POINTS])
    seen = observe(sightings, detector, BODY_POINTS, center, focal_prior(sightings, config), config, [])
    return estimate_joint_sigma(Problem(body, pairs, HIPS, seen, BODY_JOINTS, config.smoothness), state)
