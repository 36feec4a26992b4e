"""Photometric normal equations of one frame's pose: gradient and Gauss-Newton Hessian, the avatar held still.

The gradient is exact. The Hessian is that of Lucas and Kanade (1981): the rendered image's slope times the motion, in the image,
of the surface that a pixel shows. Gaussians represent the surface by their blend weights; a gaussian's part of a weighted sum of
pixels is the gradient of that sum by its colour.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.raster import State, render_backward, render_bound, render_bound_backward
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.finite import require_finite
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View, Views, person_crop

TURNING = BODY.stop
"""Number of joints that turn: pelvis and body."""
UNKNOWNS = 3 * TURNING + 3
"""Turns of the joints, each about its own axes after its rotation, and the translation."""
MASK = 1.0
"""Weight of the alpha channel beside the three of colour."""
CURVATURE = 1.7
"""Factor on the Hessian, so that a full step does not overshoot (measured: 1.2 to 1.7)."""
CLEAR = 0.1
"""Least alpha by which a pixel's slope is divided."""
FLAT = 1e-8
"""Slope below which a gaussian is left out."""
CORRELATED = 40.0
"""Values (pixels times channels) whose errors are correlated: they count as one."""
SPREAD_TURN, SPREAD_SHIFT = 0.27, 0.09
"""rad and m, sigma of the prior on a round's step (`converge`)."""
MOST = 0.12
"""rad and m, largest step of a round."""


class NormalEquations(NamedTuple):
    """Half the squared error of a frame around its pose as it stands, summed over pixels and channels."""

    gradient: np.ndarray
    """(U,)."""
    hessian: np.ndarray
    """(U, U)."""
    error: float
    """Squared error on the person."""
    pixels: int
    """Number of pixels that show the person in render or mask."""


def joint_shares(body: Body, face: np.ndarray) -> np.ndarray:
    """(N, TURNING) float32, the share of each joint's turn that moves the gaussians' faces, face (N,)."""
    below = np.zeros((len(body.parents), TURNING))
    for joint in range(len(body.parents)):
        above = joint
        while above >= 0:
            if above < TURNING:
                below[joint, above] = 1
            above = body.parents[above]
    return (body.weights[body.faces[face]].mean(1) @ below).astype(np.float32)


class Residuals(NamedTuple):
    """How a frame's render differs from it."""

    state: State
    """Of the rendering."""
    colour: np.ndarray
    """(h, w, 3) residuals."""
    mask: np.ndarray
    """(h, w) residuals times `MASK`."""
    slope: np.ndarray
    """(h, w, 3) of `compare`."""
    error: float
    """Squared error on the person."""
    pixels: int
    """Number of pixels that show the person in render or mask."""

    @property
    def mean(self) -> float:
        """Squared error of one channel of one pixel."""
        return self.error / max(4 * self.pixels, 1)


def find_residuals(gaussians: Gaussians, poses: Poses, t: int, view: View, workspace: Workspace) -> Residuals:
    """Of frame t in its view."""
    rendering = render_bound(poses.vertices(t), poses.body.faces, gaussians, view.camera, workspace)
    height, width = rendering.alpha.shape
    colour, mask = np.empty((height, width, 3), np.float32), np.empty((height, width), np.float32)
    slope, squares = np.empty((height, width, 3), np.float32), np.empty((height * width, 4), np.float32)
    pixels = compare(rendering.rgb, rendering.alpha, view.pixels, np.float32(np.sqrt(MASK)), colour, mask, slope, squares)
    return Residuals(rendering.state, colour, mask, slope, float(squares[:pixels].sum()), pixels)


def normal_equations(gaussians: Gaussians, share: np.ndarray, poses: Poses, t: int, view: View,
                     workspace: Workspace) -> NormalEquations:
    """Of frame t in its view. share: (N, TURNING) `joint_shares` of the gaussians."""
    return differentiate(find_residuals(gaussians, poses, t, view, workspace), share, poses, t, view)


def differentiate(found: Residuals, share: np.ndarray, poses: Poses, t: int, view: View) -> NormalEquations:
    """The normal equations of the residuals that frame t has with its pose as it stands, before its workspace is used again.

    share: (N, TURNING) `joint_shares` of the gaussians.
    """
    means = found.state.means.copy()
    grads = render_bound_backward(found.state, found.colour, found.mask)
    grad_pose, grad_transl, _, _ = poses.gradients(t, grads.vertices)
    turns = rotation.by_turns(poses.pose[t, BODY], grad_pose[BODY])
    tensors = render_backward(found.state, found.slope, np.zeros_like(found.mask)).rgb
    used = np.flatnonzero(tensors[:, 0] + tensors[:, 2] > FLAT)
    rows = np.empty((2 * len(used), UNKNOWNS), np.float32)
    _rows(used, means, tensors, share, *_axes(poses, t), np.array(view.camera.focal, np.float32), rows)
    return NormalEquations(np.concatenate([turns.ravel(), grad_transl]), CURVATURE * (rows.T @ rows).astype(np.float64),
                           found.error, found.pixels)


def converge(gaussians: Gaussians, poses: Poses, frames: Iterable[int], views: Views, rounds: int) -> None:
    """Moves the poses of some frames to their images, the avatar held still. views: frame -> view.

    Levenberg and Marquardt: a round that draws the frame worse is undone, and the next one steps shorter.
    """
    share = joint_shares(poses.body, gaussians.face)
    spread = np.diag(np.append(np.full(3 * TURNING, SPREAD_TURN**-2), np.full(3, SPREAD_SHIFT**-2)))

    def one(t: int, workspace: Workspace) -> None:
        view, damping = person_crop(views[t]), 1.0
        pose, transl = poses.pose[t].copy(), poses.transl[t].copy()
        found = find_residuals(gaussians, poses, t, view, workspace)
        least, normal = found.mean, differentiate(found, share, poses, t, view)
        for number in range(rounds):
            known = 1 / (max(least, 1e-5) * CORRELATED)
            move = np.linalg.solve(known * normal.hessian + damping * spread, -known * normal.gradient)
            require_finite(f"in round {number} of its pose", {f"move of frame {t}": move})
            move = np.clip(move, -MOST, MOST)
            turns = rotation.exp(move[:-3].reshape(TURNING, 3))
            poses.pose[t, BODY], poses.transl[t] = rotation.log(rotation.exp(pose[BODY]) @ turns), transl + move[-3:]
            found = find_residuals(gaussians, poses, t, view, workspace)
            if found.mean < least:
                pose, transl, least, damping = poses.pose[t].copy(), poses.transl[t].copy(), found.mean, max(damping / 2, 1.0)
                if number + 1 < rounds:
                    normal = differentiate(found, share, poses, t, view)
            else:
                damping *= 8
        poses.pose[t], poses.transl[t] = pose, transl

    side_by_side(one, map(int, frames))


def _axes(poses: Poses, t: int) -> tuple[np.ndarray, np.ndarray]:
    """Axes (TURNING, 3, 3), as columns, and places (TURNING, 3) m of the joints in the camera frame."""
    transforms, joints = poses.transforms(t)[BODY], poses.rest(t)[1][BODY]
    places = np.einsum("jab,jb->ja", transforms[:, :, :3], joints) + transforms[:, :, 3] + poses.transl[t]
    return transforms[:, :, :3].astype(np.float32), places.astype(np.float32)


@own_kernel(nogil=True, error_model="numpy")
def compare(rgb, alpha, pixels, weight, colour, mask, slope, squares):
    """Residuals of a render, rgb (h, w, 3) and alpha (h, w), against its frame, pixels (h, w, 4); weight: of the mask's.

    Writes colour (h, w, 3) and mask (h, w), the residuals, that of the mask weighted once more; slope (h, w, 3), products of the
    render's slopes (across twice, across and down, down twice) over alpha; squares (h w, 4), squared residuals of the pixels that
    show the person, whose number it returns.
    """
    height, width = alpha.shape
    byte, byte_mask, half = np.float32(1 / 255), np.float32(weight / np.float32(255)), np.float32(0.5)
    across, down, number = np.empty(4, np.float32), np.empty(4, np.float32), 0
    for y in range(height):
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(width):
            left, right = max(x - 1, 0), min(x + 1, width - 1)
            wide, tall = half if right - left == 2 else np.float32(1), half if below - above == 2 else np.float32(1)
            for c in range(3):
                across[c] = (rgb[y, right, c] - rgb[y, left, c]) * wide
                down[c] = (rgb[below, x, c] - rgb[above, x, c]) * tall
                colour[y, x, c] = rgb[y, x, c] - np.float32(pixels[y, x, c]) * byte
            across[3] = (weight * alpha[y, right] - weight * alpha[y, left]) * wide
            down[3] = (weight * alpha[below, x] - weight * alpha[above, x]) * tall
            off = weight * alpha[y, x] - np.float32(pixels[y, x, 3]) * byte_mask
            mask[y, x] = weight * off
            xx, xy, yy = np.float32(0), np.float32(0), np.float32(0)
            for c in range(4):
                xx += across[c] * across[c]
                xy += across[c] * down[c]
                yy += down[c] * down[c]
            shared = max(alpha[y, x], np.float32(CLEAR))
            slope[y, x, 0], slope[y, x, 1], slope[y, x, 2] = xx / shared, xy / shared, yy / shared
            if alpha[y, x] > half or pixels[y, x, 3] > 127:
                for c in range(3):
                    squares[number, c] = colour[y, x, c] * colour[y, x, c]
                squares[number, 3] = off * off
                number += 1
    return number


@own_kernel(nogil=True, error_model="numpy")
def _rows(used, means, tensors, share, axes, places, focal, rows):
    """Two rows a gaussian of those used: its motion in the image by each unknown, times the root of its slope tensor [a b; b c]."""
    last = 3 * axes.shape[0]
    for at, i in enumerate(used):
        x, y, z = means[i, 0], means[i, 1], means[i, 2]
        fx, fy = focal[0] / z, focal[1] / z
        a = np.sqrt(max(tensors[i, 0], np.float32(1e-12)))
        b = tensors[i, 1] / a
        c = np.sqrt(max(tensors[i, 2] - b * b, np.float32(0)))
        for j in range(axes.shape[0]):
            w = share[i, j]
            ax, ay, az = x - places[j, 0], y - places[j, 1], z - places[j, 2]
            for k in range(3):
                if w == 0:
                    rows[2 * at, 3 * j + k] = rows[2 * at + 1, 3 * j + k] = 0
                    continue
                ex, ey, ez = axes[j, 0, k], axes[j, 1, k], axes[j, 2, k]
                mx, my, mz = w * (ey * az - ez * ay), w * (ez * ax - ex * az), w * (ex * ay - ey * ax)
                u, v = fx * (mx - x / z * mz), fy * (my - y / z * mz)
                rows[2 * at, 3 * j + k] = a * u + b * v
                rows[2 * at + 1, 3 * j + k] = c * v
        rows[2 * at, last], rows[2 * at + 1, last] = a * fx, 0
        rows[2 * at, last + 1], rows[2 * at + 1, last + 1] = b * fy, c * fy
        rows[2 * at, last + 2] = -(a * fx * x + b * fy * y) / z
        rows[2 * at + 1, last + 2] = -c * fy * y / z
