"""The poses of all frames while they are refined: vertices from poses, and steps of the poses from the vertices' gradients."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams, split_pose
from gsac.avatar.correctives import move_rest_backward
from gsac.avatar.joints import BODY, JAW, JAW_EYES
from gsac.avatar.skinning import joint_transforms, skin_backward
from gsac.stages.train.checkpoint import State
from gsac.stages.train.choose_heldout import carry_corrections
from gsac.stages.train.poses.interpolate import follow_neighbours
from gsac.stages.train.poses.newton import NewtonSteps

HAND_SHARE = 0.1
"""Rate of the fingers relative to the body's: images constrain them weakly."""
TURN, SHIFT = 0.05, 0.02
"""rad and m, units of a pose's distance from its start."""
JOINT = 0.01
"""m, unit of a joint's distance from its own."""
KEPT = ("pose", "transl", "base_pose", "base_transl", "moments", "count", "offset", "betas", "expression",
        "joint_offset", "joint_moments", "joint_count")
"""Attributes of Poses that training changes."""


def carry_to_untrained(poses: Poses, trained: np.ndarray) -> Poses:
    """A copy in which untrained frames are interpolated between trained neighbours, or corrected like them.

    trained: (n,) indices of frames.
    """
    is_trained = np.zeros(len(poses.pose), bool)
    is_trained[trained] = True
    out = poses.copy()
    out.pose, out.transl = carry_corrections(out.base_pose, out.base_transl, out.pose, out.transl, is_trained)
    out.pose, out.transl = follow_neighbours(out.fit_pose, out.fit_transl, out.pose, out.transl, is_trained)
    if out.expression.any():
        frames, at = np.arange(len(out.pose)), np.flatnonzero(is_trained)
        out.expression = np.stack([np.interp(frames, at, column[at]) for column in out.expression.T], 1)
        for t in np.flatnonzero(~is_trained).tolist():
            out.forget_expression(t)
    return out


def adam_move(moments: np.ndarray, count: int, grad: np.ndarray, rate: float, fresh: float = 0.01,
              tiny: float = 1e-12) -> np.ndarray:
    """(...) to subtract at the count-th gradient, grad (...); moments (2, ...) are updated in place.

    fresh: share of a new square in the second moment; tiny: least of its root.
    """
    first, second = moments
    first += 0.1 * (grad - first)
    second += fresh * (grad**2 - second)
    return rate * (first / (1 - 0.9**count)) / (np.sqrt(second / (1 - (1 - fresh)**count)) + tiny)


class Poses:
    """Poses of T frames with Adam's state; each frame counts its own steps."""

    def __init__(self, body: Body, params: BodyParams):
        """params: of T frames, left as they are."""
        self.body, self.params = body, params
        self.fit_pose = np.array(params.pose, np.float64)
        self.fit_transl = np.array(params.transl, np.float64)
        self.base_pose, self.base_transl = self.fit_pose.copy(), self.fit_transl.copy()
        """Where the corrections of single frames start from: the fit, until `settle`."""
        self.pose, self.transl = self.fit_pose.copy(), self.fit_transl.copy()
        self.share = np.full((self.pose.shape[1], 1), HAND_SHARE)
        self.share[BODY] = 1
        self.share[JAW_EYES] = 0
        frames = len(self.pose)
        self.moments = np.zeros((2, frames, self.pose.shape[1] + 1, 3))
        self.count = np.zeros(frames, np.int64)
        self.offset = np.zeros((len(body.v_template), 3), np.float32)
        """(V, 3) m, added to the vertices at rest."""
        self.rests: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self.shaped: tuple[np.ndarray, np.ndarray] | None = None
        self.moved: dict[int, np.ndarray] = {}
        self.rest_expression = params.rest_expression
        """(E,) of the face at rest, or None, neutral."""
        self.expression = np.zeros((frames, body.exprdirs.shape[2]))
        """(T, E), learned on top of the fit's, as is `joint_offset` (55, 3) m on top of the joints at rest."""
        self.joint_offset, self.joint_moments, self.joint_count = np.zeros((55, 3)), np.zeros((2, 55, 3)), 0
        self.joint_share = self.share.copy()
        self.joint_share[0] = 0  # the pelvis is where the translation puts it
        self.betas = np.array(params.betas, np.float64)
        self.newton: dict[int, NewtonSteps] = {}
        """Frame -> its steps of pelvis, body joints and transl, once they are known; until then, and for the fingers, Adam's."""

    def copy(self) -> Poses:
        """An independent copy; steps start anew."""
        other = copy.copy(self)
        other.newton = {}
        other.pose, other.transl, other.expression = self.pose.copy(), self.transl.copy(), self.expression.copy()
        other.rests, other.moved = dict(self.rests), dict(self.moved)
        other.moments, other.count = np.zeros_like(self.moments), np.zeros_like(self.count)
        return other

    def state(self) -> State:
        """All that training changes, for a checkpoint."""
        return {name: getattr(self, name) for name in KEPT} | {"newton": {str(t): vars(steps) for t, steps in self.newton.items()}}

    def restore(self, state: State) -> None:
        """Takes the place of the Poses that `state` was called on."""
        for name in KEPT:
            setattr(self, name, state[name])
        self.newton = {int(t): NewtonSteps(**steps) for t, steps in state["newton"].items()}
        self.forget_rests()

    def forget_rests(self) -> None:
        """To be called when the betas have changed."""
        self.rests = {}
        self.shaped = None

    def forget_expression(self, t: int) -> None:
        """To be called when that of frame t has changed."""
        self.rests.pop(t, None)
        self.moved.pop(t, None)

    def forget_expressions(self) -> None:
        """To be called when expressions have changed."""
        self.rests, self.moved = {}, {}

    def rest(self, t: int) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (V, 3) float32 m and joints (55, 3) m at rest, with the frame's expression."""
        if t not in self.rests:
            p = self.params
            if self.shaped is None:
                self.shaped = self.body.rest(self.betas, None, p.joint_offset)
            if t not in self.moved:
                jaw = self.body.jaw_actions @ self.pose[t, JAW].astype(np.float32)
                expression = np.asarray(p.expression[t] + jaw + self.expression[t], np.float32)
                self.moved[t] = self.body.express(expression) if expression.any() else np.float32(0)
            vertices, joints = self.shaped
            self.rests[t] = np.ascontiguousarray(vertices + self.moved[t], np.float32), np.asarray(joints, np.float64)
        vertices, joints = self.rests[t]
        return vertices, joints + self.joint_offset

    def at_rest(self) -> np.ndarray:
        """(V, 3) float32 m, in the T-pose and with the person's face at rest."""
        return self.body.rest(self.betas, self.rest_expression, self.params.joint_offset)[0]

    def vertices(self, t: int) -> np.ndarray:
        """(V, 3) float32 m, camera frame, in the frame's pose as it is now."""
        rest, joints = self.rest(t)
        return self.body.bend(rest + self.offset, joints, self.pose[t]) + self.transl[t].astype(np.float32)

    def settle(self) -> None:
        """Makes the poses as they stand the base that single frames are corrected from; Adam starts anew."""
        self.base_pose, self.base_transl = self.pose.copy(), self.transl.copy()
        self.moments, self.count = np.zeros_like(self.moments), np.zeros_like(self.count)

    def transforms(self, t: int) -> np.ndarray:
        """(55, 3, 4) from rest to posed, without transl."""
        return joint_transforms(self.pose[t:t + 1], self.rest(t)[1], self.body.parents)[0]

    def gradients(self, t: int, grad_vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Gradients of pose (55, 3), transl (3,), rest vertices (V, 3) and joints (55, 3) from grad_vertices (V, 3)."""
        rest, joints = self.rest(t)
        body, rest = self.body, self.body.correct(rest + self.offset, self.pose[t])
        grad_pose, grad_transl, grad_rest, grad_joints = skin_backward(
            np.ascontiguousarray(grad_vertices, np.float32), self.pose[t], rest, joints, body.parents, body.skin_index,
            body.skin_weight)
        if body.posedirs is not None:
            grad_pose = grad_pose + move_rest_backward(body.posedirs, self.pose[t], grad_rest)
        return grad_pose, grad_transl, grad_rest, grad_joints

    def step(self, t: int, grad_vertices: np.ndarray, rate: float, pull: float) -> tuple[np.ndarray, np.ndarray]:
        """One step of frame t. grad_vertices: (V, 3). Returns the gradients of rest vertices (V, 3) and joints (55, 3).

        rate: Adam's; 0: the pose stays; pull: weight of the squared distance from the base, for Adam.
        """
        grad_pose, grad_transl, grad_rest, grad_joints = self.gradients(t, grad_vertices)
        grad = np.concatenate([grad_pose, grad_transl[None]]).astype(np.float64)
        grad[:-1] += 2 * pull * (self.pose[t] - self.base_pose[t]) / TURN**2
        grad[-1] += 2 * pull * (self.transl[t] - self.base_transl[t]) / SHIFT**2
        self.count[t] += 1
        move = adam_move(self.moments[:, t], self.count[t], grad, rate)
        turn, shift = self.share * move[:-1], move[-1]
        if rate and t in self.newton:
            by_turns = rotation.by_turns(self.pose[t, BODY], grad_pose[BODY])
            taken = self.newton[t].step(np.append(by_turns, grad_transl))
            self.pose[t, BODY] = rotation.log(rotation.exp(self.pose[t, BODY]) @ rotation.exp(taken[:-3].reshape(-1, 3)))
            turn[BODY], shift = 0, -taken[-3:]
        self.pose[t] -= turn
        self.transl[t] -= shift
        return grad_rest, grad_joints

    def shape_gradient(self, grad_rest: np.ndarray, grad_joints: np.ndarray) -> np.ndarray:
        """(B,) gradient of the betas from grad_rest (V, 3), of the rest vertices, and grad_joints (55, 3)."""
        on_vertices = grad_rest + self.body.J_regressor.T @ grad_joints
        return np.tensordot(on_vertices, self.body.shapedirs[:, :, :len(self.betas)], 2)

    def expression_gradient(self, grad_rest: np.ndarray) -> np.ndarray:
        """(E,) gradient of a frame's expression from grad_rest (V, 3), of its rest vertices."""
        moved, directions = self.body.expressive
        return np.tensordot(grad_rest[moved], directions, 2)

    def wear_expression(self, t: int, expression: np.ndarray) -> None:
        """Sets what frame t has on top of the fit's expression, (E,), as far as the body's actions go."""
        if self.body.has_actions:
            fitted = self.params.expression[t]
            expression = np.clip(fitted + expression, 0, 1) - fitted
        self.expression[t] = expression
        self.forget_expression(t)

    def step_joints(self, grad: np.ndarray, rate: float, pull: float) -> None:
        """One Adam step of the joints at rest, which all frames share. grad: (55, 3)."""
        grad = grad + 2 * pull * self.joint_offset / JOINT**2
        self.joint_count += 1
        self.joint_offset -= self.joint_share * adam_move(self.joint_moments, self.joint_count, grad, rate)

    def to_params(self) -> BodyParams:
        """The parameters with the poses as they stand; `joints` computed anew."""
        params = replace(self.params, betas=self.betas.astype(np.float32), **split_pose(self.pose),
                         transl=self.transl.astype(np.float32),
                         expression=(self.params.expression + self.expression).astype(np.float32),
                         rest_expression=self.rest_expression,
                         joint_offset=(self.params.joint_offset + self.joint_offset).astype(np.float32))
        params.joints = self.body.posed_joints(params)
        return params
