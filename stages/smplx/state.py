"""The unknowns of a fit, and the result of a fit by either method."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.stages.findings import Code, Finding


@dataclass
class State:
    """The unknowns of one clip."""

    local: np.ndarray  # (T, J, 3, 3) joint rotations
    transl: np.ndarray  # (T, 3) m
    betas: np.ndarray  # (B,)
    log_focal: float
    stance: np.ndarray
    """(H,) the clip's upright and mean pose, as in lm/stance.py; empty where they are not unknowns."""
    own: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(K,) the person's own offsets, as in lm/person_offsets.py; empty where they are not unknowns."""
    level: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(G,) m, G is 0 or 1: height of the ground along the upright, as in lm/ground.py; empty without a ground."""

    @property
    def shape(self) -> np.ndarray:
        """(B + K,) unknowns that do not move with the pose."""
        return np.concatenate([self.betas, self.own])

    @property
    def shared(self) -> int:
        """Number of unknowns that all frames share."""
        return 1 + len(self.shape) + len(self.stance) + len(self.level)


@dataclass
class Fit:
    """The result of a fit."""

    state: State
    sigma_joints: np.ndarray  # (T, 55) m
    iou: np.ndarray
    """(T,) of body and alpha, by `lm` before its last round; NaN without alpha."""
    reprojection: np.ndarray  # (T,) median px of the body points
    steps: int
    joint_offset: np.ndarray | None = None  # (55, 3) m, where the method moves joints
    notes: tuple[Finding, ...] = ()
    """Sentences for the user."""
    arms: dict[Code, np.ndarray] = field(default_factory=dict)
    """What is to be said of arms -> (T, 2) bool, in which frames, left and right."""
    cost: float = np.nan
    """By `lm`, of all but the fingers."""
    uncovered: np.ndarray | None = None
    """(T,) area of the alpha beside the body, as a share of the person's height squared; None where it is not measured."""


def to_params(body: Body, state: State, center: np.ndarray, expression: np.ndarray | None = None,
              joint_offset: np.ndarray | None = None) -> BodyParams:
    """The state as body.npz holds it. center: (2,) px; expression: (T, E), zero if None; joint_offset: (55, 3) m, zero if None."""
    if expression is None:
        expression = np.zeros((len(state.local), body.exprdirs.shape[2]))
    params = BodyParams.from_pose(rotation.log(state.local), state.transl, state.betas, expression, np.exp(state.log_focal),
                                  center, model=body.digest)
    if joint_offset is not None:
        params.joint_offset = joint_offset.astype(np.float32)
    return params
