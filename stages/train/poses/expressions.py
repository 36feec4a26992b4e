"""Each frame's own expression: Gauss-Newton steps to its image, cut to the face, the avatar held still.

The face stage reads lips to about a pixel. An avatar that learns from frames whose lips are a pixel off has a smear for a mouth.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import HEAD
from gsac.avatar.raster import render_backward, render_bound_backward
from gsac.avatar.resting_face import find_resting_face
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.finite import require_finite
from gsac.stages.train.poses.photometric import CORRELATED, CURVATURE, FLAT, Residuals, find_residuals
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

SPREAD = 0.1
"""Sigma of what the face stage is off by, in full actions."""
FACING = -0.4
"""Least `find_facing` of a frame: somewhat beyond a profile, where the face stage sees nothing, lips and brows still show."""
MOVES, CARRIES = 2e-3, 2e-4
"""m by which a full action moves the vertices that bound the crop, and the gaussians that tell of it."""
MARGIN, LEAST_SIDE = 3, 4
"""px about these vertices, and of the smallest crop that is looked at."""


def find_facing(poses: Poses, t: int) -> float:
    """Cosine between where the head looks in frame t and the way to the camera."""
    looks, away = poses.transforms(t)[HEAD, :, 2], poses.transl[t]
    return float(-looks @ away / np.linalg.norm(away))


class Actions:
    """How a body's expressions move the gaussians of an avatar."""

    def __init__(self, poses: Poses, face: np.ndarray):
        """face: (N,) of the gaussians."""
        body = poses.body
        self.poses, (moved, directions) = poses, body.expressive
        self.bounds = moved[np.abs(directions).max((1, 2), initial=0) > MOVES]
        ways = body.exprdirs[body.faces[face]].mean(1)
        self.carried = np.flatnonzero(np.abs(ways).max((1, 2), initial=0) > CARRIES)
        self.ways = ways[self.carried]
        """(C, 3, E) m at rest, of the gaussians that are moved."""
        self.weights = body.weights[body.faces[face[self.carried]]].mean(1)

    def crop(self, t: int, view: View) -> View | None:
        """The view cut to the face of frame t; None where it is turned away, or not in the view."""
        poses = self.poses
        if not len(self.bounds) or find_facing(poses, t) < FACING:
            return None
        camera, points = view.camera, poses.vertices(t)[self.bounds]
        across, down = (camera.focal[k] * points[:, k] / points[:, 2] + camera.center[k] for k in (0, 1))
        x0, y0 = (max(int(at.min()) - MARGIN, 0) for at in (across, down))
        x1, y1 = (min(int(at.max()) + MARGIN + 1, size) for at, size in ((across, camera.width), (down, camera.height)))
        return view.crop(x0, y0, x1, y1) if min(x1 - x0, y1 - y0) >= LEAST_SIDE else None

    def equations(self, t: int, view: View, found: Residuals) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (E,) and Hessian (E, E) by the expression of frame t, of half the squared error `found` in the view."""
        means = found.state.means[self.carried]
        grads = render_bound_backward(found.state, found.colour, found.mask)
        gradient = self.poses.expression_gradient(self.poses.gradients(t, grads.vertices)[2])
        tensors = render_backward(found.state, found.slope, np.zeros_like(found.mask)).rgb[self.carried]
        used = np.flatnonzero(tensors[:, 0] + tensors[:, 2] > FLAT)
        turns = np.tensordot(self.weights[used], self.poses.transforms(t)[:, :, :3], 1)
        moves = turns @ self.ways[used]
        x, y, z = means[used].T[..., None]
        (fx, fy), (xx, xy, yy) = view.camera.focal, tensors[used].T[..., None]
        across, down = (f / z * (moves[:, k] - at / z * moves[:, 2]) for k, f, at in ((0, fx, x), (1, fy, y)))
        hessian = across.T @ (xx * across + xy * down) + down.T @ (xy * across + yy * down)
        return gradient, CURVATURE * hessian


def correct_expressions(poses: Poses, gaussians: Gaussians, views: dict[int, View]) -> None:
    """Takes one step of the expressions of frames that show the face, but none that draws the face worse. views: frame -> view, of
    the size that the gaussians have learned from: finer images mislead an avatar that is still soft.

    Raises StageError where an expression is not finite.
    """
    actions = Actions(poses, gaussians.face)
    prior = np.eye(poses.body.exprdirs.shape[2]) / SPREAD**2

    def one(frame: tuple[int, View], workspace: Workspace) -> None:
        t, view = frame
        face = actions.crop(t, view)
        if face is None:
            return
        kept = poses.expression[t].copy()
        found = find_residuals(gaussians, poses, t, face, workspace)
        before, (gradient, hessian) = found.mean, actions.equations(t, face, found)
        known = 1 / (max(before, 1e-5) * CORRELATED)
        step = np.linalg.solve(known * hessian + prior, -known * gradient - prior @ kept)
        require_finite("late in the training", {f"correction of frame {t}'s expression": step})
        poses.wear_expression(t, kept + step)
        if find_residuals(gaussians, poses, t, face, workspace).mean >= before:
            poses.wear_expression(t, kept)

    side_by_side(one, views.items())


def find_rest(poses: Poses, trained: np.ndarray) -> np.ndarray | None:
    """(E,), the fit's face at rest, moved as the trained frames, (n,) indices, have on the whole; None where it has none."""
    rest, fitted = poses.params.rest_expression, poses.params.expression[trained]
    if rest is None:
        return None
    facing = np.array([find_facing(poses, int(t)) for t in trained])
    before, now = (find_resting_face(c, facing) for c in (fitted, fitted + poses.expression[trained]))
    return np.clip(rest + now - before, 0, 1).astype(np.float32)
