"""Heights over the body: images from one side do not tell depth, so none may stand off the surface that those around it make."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import FaceFrames, bind
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians.nearest import find_nearest

AROUND, STEP = 24, 0.02
"""Gaussians whose median height is the surface at a place, and m that one may lie above or below it."""
SPARSE = 3000
"""Gaussians of an avatar below which STEP and TALL grow with their spacing: shrunk, they would leave holes."""
EXTENT = 2.0
"""Standard deviations from the middle of a gaussian to its outer end."""
TALL, UNEVEN = 0.016, 5.0
"""m, and median deviations of those around it, by which an end may stand above their median, whichever is more: cloth that
flutters is uneven everywhere, a spike is one of few."""


def level_heights(gaussians: Gaussians, frames: FaceFrames) -> Gaussians:
    """The gaussians, moved to within STEP (`SPARSE`: more) of the median height around them. frames: of all faces at rest.

    One whose standard deviation along the face's normal is larger than that shrinks to it; then spikes are cut.
    """
    step = STEP * spacing_factor(len(gaussians))
    size, around = np.maximum(frames.k[gaussians.face], 1e-9), find_around(gaussians, frames)
    height = size * gaussians.mu[:, 1]
    usual = np.median(height[around], axis=1)
    out = gaussians[np.arange(len(gaussians))]
    out.mu[:, 1] = np.clip(height, usual - step, usual + step) / size
    sigma = np.linalg.norm(along_normal(gaussians, frames), axis=1)
    out.log_scale += np.minimum(0, np.log(step / np.maximum(sigma, 1e-9)))[:, None].astype(np.float32)
    return cut_spikes(out, frames, around)


def cut_spikes(gaussians: Gaussians, frames: FaceFrames, around: np.ndarray) -> Gaussians:
    """The gaussians, those whose outer ends stand far above the ends around them flattened along the face's normal, no more than is
    usual there, and lowered by the rest.

    Of a limb that is seen before the trunk alone some gaussians show the shirt behind it; from any other side they are spikes.
    frames: of all faces at rest; around: (N, AROUND) of `find_around`.
    """
    size, axes = np.maximum(frames.k[gaussians.face], 1e-9), along_normal(gaussians, frames)
    height, extent = size * gaussians.mu[:, 1], np.maximum(EXTENT * np.linalg.norm(axes, axis=1), 1e-9)
    ends = (height + extent)[around]
    usual = np.median(ends, axis=1)
    uneven = UNEVEN * np.median(np.abs(ends - usual[:, None]), axis=1)
    over = np.maximum(height + extent - usual - np.maximum(uneven, TALL * spacing_factor(len(gaussians))), 0)
    kept = np.maximum(1 - over / extent, np.minimum(np.median(extent[around], axis=1) / extent, 1))
    upright = axes / (np.exp(gaussians.log_scale) * size[:, None])
    flattened = 1 - (1 - kept[:, None]) * upright**2
    lower = over - extent + EXTENT * np.linalg.norm(axes * flattened, axis=1)
    out = gaussians[np.arange(len(gaussians))]
    out.log_scale += np.log(flattened).astype(np.float32)
    out.mu[:, 1] -= np.where(over > 0, np.maximum(lower, 0) / size, 0)
    return out


def along_normal(gaussians: Gaussians, frames: FaceFrames) -> np.ndarray:
    """(N, 3) m, how far each gaussian's axes, one standard deviation long, reach along the normal of its face."""
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    return np.einsum("ni,nij->nj", frames.R[gaussians.face, :, 1], bound.rotations) * bound.scales


def spacing_factor(count: int) -> float:
    """How much more than those of `SPARSE` gaussians and more fewer of them may stand off."""
    return max(1, SPARSE / max(count, 1)) ** 0.5


def find_heights(gaussians: Gaussians, frames: FaceFrames) -> tuple[np.ndarray, np.ndarray]:
    """(N,) m over the face that carries each gaussian, and (N,) the median of `AROUND` gaussians there. frames: of all faces."""
    height = frames.k[gaussians.face] * gaussians.mu[:, 1]
    return height, np.median(height[find_around(gaussians, frames)], axis=1)


def find_around(gaussians: Gaussians, frames: FaceFrames) -> np.ndarray:
    """(N, AROUND) indices of the gaussians whose faces are nearest. frames: of all faces."""
    middle = frames.T[gaussians.face]
    return find_nearest(middle, middle, AROUND)
