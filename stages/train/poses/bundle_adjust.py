"""Corrections of all frames' poses, solved together by Gauss-Newton, the avatar held still.

The body fit's error is smooth in time and in part the same in all frames, so the corrections are a Gaussian process: frames that
are not trained on are corrected as those around them are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.contract import StageError
from gsac.stages.train.finite import finite
from gsac.stages.train.holdout import near
from gsac.stages.train.poses.photometric import CORRELATED, TURNING, UNKNOWNS, Normal, carriers, normal_equations
from gsac.stages.train.poses.poses import Poses, carried
from gsac.stages.train.views import View

TURN, SHIFT = 0.1, 0.03
"""rad and m by which the fit is taken to be off."""
SAME, NEAR, OWN = 0.3, 0.6, 0.03
"""Variance of what is the same in all frames, of what changes smoothly, and of a frame's own error."""
SPAN = 0.038
"""Length of the smooth part, as a share of the clip."""
MOST = 0.15
"""rad and m of a round's step, at most."""
WORSE = 1.1
"""Growth of the squared error from round to round that is taken back."""
MOSTLY = 0.5
"""Share of the trained frames that must be near to the next."""
SOLVER_STEPS, SOLVED = 60, 1e-10
MIDWAY_ROUNDS, MIDWAY_SHARE = 2, 0.3
"""Rounds in the midst of a training, and the share of TURN and SHIFT by which its poses are still taken to be off."""


def correct_midway(poses: Poses, trained: np.ndarray, gaussians: Callable[[], Gaussians], face: np.ndarray,
                   views: dict[int, View]) -> bool:
    """Corrects all poses in the midst of a training, when the avatar tells more of them than at its start.

    trained: indices of the trained frames; gaussians, on the faces (N,): as they stand. Says whether it did: not where views
    are `apart`.
    """
    if apart(poses.fit_pose[trained, 0]):
        return False
    everywhere = carried(poses, trained)
    poses.pose[:], poses.transl[:] = everywhere.pose, everywhere.transl
    corrections = Corrections(poses, gaussians, face, views, MIDWAY_SHARE)
    for _ in range(MIDWAY_ROUNDS):
        corrections.solve()
    poses.settle()
    return True


class Corrections:
    """turns (T, TURNING, 3) rad after the rotations as they are at first and shifts (T, 3) m, as one array (T, U)."""

    def __init__(self, poses: Poses, gaussians: Callable[[], Gaussians], face: np.ndarray, views: dict[int, View],
                 share: float = 1.0):
        """share: of `TURN` and `SHIFT` by which the poses are taken to be off."""
        self.poses, self.gaussians, self.views = poses, gaussians, views
        self.first_pose, self.first_transl = poses.pose.copy(), poses.transl.copy()
        frames = len(poses.pose)
        self.share = carriers(poses.body, face)
        self.root = np.linalg.cholesky(covariance(frames))
        self.spread = share * np.append(np.full(3 * TURNING, TURN), np.full(3, SHIFT))
        self.values = np.zeros((frames, UNKNOWNS))
        self.kept, self.error = self.values, np.inf

    def solve(self) -> None:
        """One Gauss-Newton step of all frames. A step that made the images worse is taken back instead."""
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

        def pulled(y):
            return root.T @ (y * spread)

        def apply(z):
            return z + known * pulled(np.einsum("tab,tb->ta", hessian, (root @ z) * spread))

        z = conjugate_gradients(apply, -known * pulled(gradient - np.einsum("tab,tb->ta", hessian, before)))
        self.values = before + np.clip((root @ z) * spread - before, -MOST, MOST)
        finite("after a round of poses", {"correction of the poses": self.values})
        self.place()

    def equations(self, gaussians: Gaussians) -> list[tuple[int, Normal]]:
        """Of every frame, in the order of the views."""

        def of_frame(frame: tuple[int, View], workspace: Workspace) -> tuple[int, Normal]:
            t, view = frame
            return t, normal_equations(gaussians, self.share, self.poses, t, view, workspace)

        return side_by_side(of_frame, self.views.items())

    def place(self) -> None:
        """Poses as corrected."""
        poses, turns = self.poses, self.values[:, :-3].reshape(-1, TURNING, 3)
        poses.pose[:, BODY] = rotation.log(rotation.exp(self.first_pose[:, BODY]) @ rotation.exp(turns))
        poses.transl[:] = self.first_transl + self.values[:, -3:]


def apart(global_orient: np.ndarray) -> bool:
    """global_orient: (T, 3) axis-angle. Whether most views are not near to the next."""
    return len(global_orient) > 1 and np.mean(near(global_orient[:-1], global_orient[1:])) < MOSTLY


def covariance(frames: int) -> np.ndarray:
    """(T, T) of the corrections, in units of their spread."""
    apart = np.arange(frames)[:, None] - np.arange(frames)
    return SAME + NEAR * np.exp(-0.5 * (apart / (SPAN * frames)) ** 2) + OWN * (apart == 0)


def conjugate_gradients(apply, b: np.ndarray) -> np.ndarray:
    """x of apply(x) = b, apply linear, symmetric and positive."""
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
