"""Bundle adjustment: corrects the poses of all frames together by Gauss-Newton, the avatar held still.

The body fit's error is smooth in time and in part the same in all frames, so the prior of the corrections is a Gaussian process:
untrained frames are corrected like those around them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.contract import StageError
from gsac.stages.train.choose_heldout import is_near
from gsac.stages.train.finite import require_finite
from gsac.stages.train.poses.photometric import CORRELATED, TURNING, UNKNOWNS, NormalEquations, joint_shares, normal_equations
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.views import View

TURN, SHIFT = 0.1, 0.03
"""rad and m, sigma of the fit's error."""
SAME, NEAR, OWN = 0.3, 0.6, 0.03
"""Variance of the error's constant part, of its smooth part, and of a frame's own part, in units of that sigma."""
SPAN = 0.038
"""Length scale of the smooth part, as a share of the clip."""
MOST = 0.15
"""rad and m, largest step of a round."""
WORSE = 1.1
"""Factor on the squared error from round to round above which the step is undone."""
MOSTLY = 0.5
"""Least share of the trained frames that are near to the next one."""
SOLVER_STEPS, SOLVED = 60, 1e-10
"""Most steps of conjugate gradients, and the share of the squared residual at which they end."""
MIDWAY_SHARE = 0.3
"""Share of TURN and SHIFT that is still their sigma midway through a training."""


Equations = Callable[[Gaussians], list[tuple[int, NormalEquations]]]
"""Of gaussians: each frame with its normal equations, the poses as they stand."""


def correct_midway(poses: Poses, trained: np.ndarray, gaussians: Callable[[], Gaussians], equations: Equations) -> None:
    """Corrects all poses midway through a training, when the avatar constrains them better than at the start.

    trained: (n,) indices of frames; gaussians: returns them as they stand. Nothing moves where views `are_apart`.
    """
    if are_apart(poses.fit_pose[trained, 0]):
        return
    everywhere = carry_to_untrained(poses, trained)
    poses.pose[:], poses.transl[:] = everywhere.pose, everywhere.transl
    Corrections(poses, gaussians, equations, MIDWAY_SHARE).solve()
    poses.settle()


class FrameEquations:
    """`Equations` on the CPU, the frames side by side."""

    def __init__(self, poses: Poses, face: np.ndarray, views: dict[int, View]):
        """face: (N,) of the gaussians; views: frame -> view."""
        self.poses, self.views, self.share = poses, views, joint_shares(poses.body, face)

    def __call__(self, gaussians: Gaussians) -> list[tuple[int, NormalEquations]]:
        def of_frame(frame: tuple[int, View], workspace: Workspace) -> tuple[int, NormalEquations]:
            t, view = frame
            return t, normal_equations(gaussians, self.share, self.poses, t, view, workspace)

        return side_by_side(of_frame, self.views.items())


class Corrections:
    """The corrections of T frames, as one array (T, U): turns (TURNING, 3) rad after the first rotations, and shifts (3,) m."""

    def __init__(self, poses: Poses, gaussians: Callable[[], Gaussians], equations: Equations, share: float = 1.0):
        """gaussians: returns them as they stand; share: of TURN and SHIFT."""
        self.poses, self.gaussians, self.equations = poses, gaussians, equations
        self.first_pose, self.first_transl = poses.pose.copy(), poses.transl.copy()
        frames = len(poses.pose)
        self.root = np.linalg.cholesky(covariance(frames))
        self.spread = share * np.append(np.full(3 * TURNING, TURN), np.full(3, SHIFT))
        self.values = np.zeros((frames, UNKNOWNS))
        self.kept, self.error = self.values, np.inf

    def solve(self) -> None:
        """One Gauss-Newton step of all frames; or undoes the last step, where it made the images worse."""
        gradient, hessian = np.zeros(self.values.shape), np.zeros((*self.values.shape, UNKNOWNS))
        gaussians, error, pixels = self.gaussians(), 0.0, 0
        for t, normal in self.equations(gaussians):
            gradient[t], hessian[t] = normal.gradient, normal.hessian
            error, pixels = error + normal.error, pixels + normal.pixels
        error /= max(4 * pixels, 1)
        if not np.isfinite(error + np.sum(gradient) + np.sum(hessian)):
            raise StageError("train: the poses' equations are not finite; look at smplx/body.npz, or set train.pose_rounds to 0")
        if error > WORSE * self.error:
            self.values = self.kept
            self.place()
            return
        self.kept, self.error = self.values, error
        known = 1 / (max(error, 1e-6) * CORRELATED)
        root, spread, before = self.root, self.spread, self.values

        def pulled(y: np.ndarray) -> np.ndarray:
            return root.T @ (y * spread)

        def apply(z: np.ndarray) -> np.ndarray:
            return z + known * pulled(np.einsum("tab,tb->ta", hessian, (root @ z) * spread))

        z = conjugate_gradients(apply, -known * pulled(gradient - np.einsum("tab,tb->ta", hessian, before)))
        self.values = before + np.clip((root @ z) * spread - before, -MOST, MOST)
        require_finite("after a round of poses", {"correction of the poses": self.values})
        self.place()

    def place(self) -> None:
        """Sets the poses to the corrected ones."""
        poses, turns = self.poses, self.values[:, :-3].reshape(-1, TURNING, 3)
        poses.pose[:, BODY] = rotation.log(rotation.exp(self.first_pose[:, BODY]) @ rotation.exp(turns))
        poses.transl[:] = self.first_transl + self.values[:, -3:]


def are_apart(global_orient: np.ndarray) -> bool:
    """Whether most views are not near to the next one. global_orient: (T, 3) axis-angle."""
    return len(global_orient) > 1 and bool(np.mean(is_near(global_orient[:-1], global_orient[1:])) < MOSTLY)


def covariance(frames: int) -> np.ndarray:
    """(T, T) of the corrections, in units of their sigma."""
    apart = np.arange(frames)[:, None] - np.arange(frames)
    return SAME + NEAR * np.exp(-0.5 * (apart / (SPAN * frames)) ** 2) + OWN * (apart == 0)


def conjugate_gradients(apply: Callable[[np.ndarray], np.ndarray], b: np.ndarray) -> np.ndarray:
    """x (...) that solves apply(x) = b; b: (...); apply: linear, symmetric and positive."""
    x, rest = np.zeros_like(b), b.copy()
    way, square = rest.copy(), float((rest**2).sum())
    goal = SOLVED * square
    for _ in range(SOLVER_STEPS):
        if square <= goal:
            break
        image = apply(way)
        size = square / float((way * image).sum())
        x += size * way
        rest -= size * image
        square, last = float((rest**2).sum()), square
        way = rest + square / last * way
    return x
