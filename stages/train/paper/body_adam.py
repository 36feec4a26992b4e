"""Adam, as torch has it by default, of what recipe `paper` learns of the body: poses, expressions and betas.

A frame's pose and expression have moments and a count of their own, as parameters have whose gradient torch knows to be none.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import BODY, EYES, JAW
from gsac.stages.train.checkpoint import State
from gsac.stages.train.poses.poses import HAND_SHARE, Poses, adam_move

FRESH, TINY = 1e-3, 1e-8
"""1 - 0.999 of the second moment, and what is added to its root."""
RATE = 2e-4
"""Of orientation, body pose (rad), translation (m) and betas; hands, jaw and expression have HAND_SHARE of it."""
KEPT = ("pose", "expression", "betas", "count")
"""Attributes that go into a checkpoint."""


class BodyAdam:
    """The state of Adam, and its step."""

    def __init__(self, poses: Poses):
        self.poses = poses
        frames, joints = poses.pose.shape[:2]
        self.share = np.full((joints + 1, 1), HAND_SHARE)
        self.share[BODY], self.share[EYES], self.share[joints] = 1, 0, 1
        self.pose = np.zeros((2, frames, joints + 1, 3))
        self.expression = np.zeros((2, *poses.expression.shape))
        self.betas = np.zeros((2, len(poses.betas)))
        self.count = np.zeros(frames + 1, np.int64)
        """(T + 1,) steps of each frame, and of the betas."""

    def state(self) -> State:
        """For a checkpoint."""
        return {name: getattr(self, name) for name in KEPT}

    def restore(self, state: State) -> None:
        """Takes the place of the one that `state` was called on."""
        for name in KEPT:
            setattr(self, name, state[name])

    def step(self, grad_vertices: dict[int, np.ndarray]) -> None:
        """Moves the frames of a batch, and the betas. grad_vertices: frame -> (V, 3), of the batch's loss."""
        poses, on_betas = self.poses, np.zeros(len(self.poses.betas))
        for t, grad in grad_vertices.items():
            grad_pose, grad_transl, grad_rest, grad_joints = poses.gradients(t, grad)
            on_betas += poses.shape_gradient(grad_rest, grad_joints)
            on_expression = poses.expression_gradient(grad_rest)
            both = np.concatenate([grad_pose, grad_transl[None]]).astype(np.float64)
            both[JAW] += on_expression @ poses.body.jaw_actions
            move = self.share * self._move(self.pose[:, t], t, both)
            poses.pose[t] -= move[:-1]
            poses.transl[t] -= move[-1]
            poses.expression[t] -= HAND_SHARE * self._move(self.expression[:, t], t, on_expression, counted=True)
        poses.betas -= self._move(self.betas, -1, on_betas)
        poses.forget_rests()
        poses.forget_expressions()

    def _move(self, moments: np.ndarray, at: int, grad: np.ndarray, counted: bool = False) -> np.ndarray:
        self.count[at] += not counted
        return adam_move(moments, int(self.count[at]), grad, RATE, FRESH, TINY)
