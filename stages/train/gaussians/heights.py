"""Heights over the body: images from one side do not tell depth, so none may stand off the surface that those around it make."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import FaceFrames, bind
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians.nearest import find_nearest

AROUND, STEP = 24, 0.02
"""Gaussians whose median height is the surface at a place, and m that one may lie above or below it."""
SPARSE = 3000
"""Gaussians of an avatar below which STEP grows with their spacing: shrunk, they would leave holes."""


def level_heights(gaussians: Gaussians, frames: FaceFrames) -> Gaussians:
    """The gaussians, moved to within STEP (`SPARSE`: more) of the median height around them. frames: of all faces at rest.

    One whose standard deviation along the face's normal is larger than that shrinks to it.
    """
    step = STEP * max(1, SPARSE / max(len(gaussians), 1)) ** 0.5
    size = np.maximum(frames.k[gaussians.face], 1e-9)
    height, usual = find_heights(gaussians, frames)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    axes = np.einsum("ni,nij->nj", frames.R[gaussians.face, :, 1], bound.rotations) * bound.scales
    out = gaussians[np.arange(len(gaussians))]
    out.mu[:, 1] = np.clip(height, usual - step, usual + step) / size
    out.log_scale += np.minimum(0, np.log(step / np.maximum(np.linalg.norm(axes, axis=1), 1e-9)))[:, None].astype(np.float32)
    return out


def find_heights(gaussians: Gaussians, frames: FaceFrames) -> tuple[np.ndarray, np.ndarray]:
    """(N,) m over the face that carries each gaussian, and (N,) the median of `AROUND` gaussians there. frames: of all faces."""
    middle, height = frames.T[gaussians.face], frames.k[gaussians.face] * gaussians.mu[:, 1]
    return height, np.median(height[find_nearest(middle, middle, AROUND)], axis=1)
