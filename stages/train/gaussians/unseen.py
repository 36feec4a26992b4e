"""Gaussians that no frame shows from their front: finds them, and lays them on their neighbours' surface in their colour.

The images do not constrain them, and training would leave them as fur at edges and ragged soles. Nor do images from one side
constrain depth: no gaussian may stand off the surface that those around it make.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import FaceFrames, bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import FLATNESS, Gaussians
from gsac.avatar.light import shade
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians.added_alpha import added_alpha
from gsac.stages.train.gaussians.disc_area import divisible_areas
from gsac.stages.train.gaussians.nearest import find_nearest

BEHIND, FRONT = -0.2, 0.3
"""Cosine between a face's normal and the direction to the camera: up to the first a frame shows nothing of it, from the second on
all. The first is below zero, since gaussians just behind a limb's edge make its outline."""
LEAST_SHOWN = 0.05
"""Least pixels of a half-size frame, mean over the frames, that a seen gaussian shows of its front."""
LEAST_SHARE = 0.15
"""Least pixels per area of a seen gaussian, as a share of the median: armpits are shown little, and at a slant."""
NEIGHBOURS = 8
"""Seen gaussians that an unseen one takes after."""
AROUND, STEP = 24, 0.02
"""Gaussians whose median height is the surface at a place, and m that one may lie above or below it."""
SPARSE = 3000
"""Gaussians of an avatar below which STEP grows with their spacing: shrunk, they would leave holes."""


def front_pixels(gaussians: Gaussians, vertices: np.ndarray, faces: np.ndarray, camera: Camera,
                 workspace: Workspace) -> np.ndarray:
    """(N,) pixels that each gaussian adds to one image from its front. vertices: (V, 3) m, camera frame; faces: (F, 3)."""
    added = added_alpha(render_bound(vertices, faces, gaussians, camera, workspace))
    frames = face_frames(vertices, faces)
    normal, place = frames.R[gaussians.face, :, 1], frames.T[gaussians.face]
    facing = -(normal * place).sum(1) / np.maximum(np.linalg.norm(place, axis=1), 1e-9)
    return np.clip((facing - BEHIND) / (FRONT - BEHIND), 0, 1) * added


def find_seen(pixels: np.ndarray, gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N,) bool, whether gaussians are seen. pixels: (N,) `front_pixels`, mean over the frames; rest: (V, 3) m; faces: (F, 3)."""
    bound = bind(face_frames(rest, faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    share = pixels / divisible_areas(bound)
    seen = pixels > LEAST_SHOWN
    return seen & (share > LEAST_SHARE * np.median(share[seen])) if seen.any() else seen


def flatten_unseen(gaussians: Gaussians, seen: np.ndarray, rest: np.ndarray, faces: np.ndarray) -> Gaussians:
    """The gaussians, unseen ones as flat discs in the colour of their neighbours. seen: (N,) bool; rest: (V, 3) m; faces: (F, 3).

    They lie no higher over the body than their neighbours and are no larger. Opacity stays: it is learned from the masks.
    """
    poor = np.flatnonzero(~seen)
    if not len(poor) or not seen.any():
        return gaussians
    frames = face_frames(rest, faces)
    size, middle = np.maximum(frames.k[gaussians.face], 1e-9), frames.T[gaussians.face]
    near = np.flatnonzero(seen)[find_nearest(middle[seen], middle[poor], NEIGHBOURS)]
    out = gaussians[np.arange(len(gaussians))]
    height = np.median(size[near] * gaussians.mu[near, 1], axis=1) / size[poor]
    out.mu[poor, 1] = np.minimum(gaussians.mu[poor, 1], height)
    widths = np.sort(gaussians.log_scale, 1)[:, 1:].mean(1) + np.log(size)
    width = np.minimum(np.median(widths[near], axis=1), widths[poor]) - np.log(size[poor])
    out.log_scale[poor] = np.stack([width, width + np.log(FLATNESS), width], 1)
    out.quat[poor] = [1, 0, 0, 0]
    out.rgb[poor] = gaussians.rgb[near].mean(1)
    out.rgb[poor] = hold_colours(out, poor, near, frames.R[:, :, 1])
    return out


def hold_colours(gaussians: Gaussians, poor: np.ndarray, near: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(M, 3) colours of M gaussians, held within those of gaussians around them, and in the clip's light within these so lit.

    poor: (M,) the gaussians; near: (M, K) well seen ones around each; normals: (F, 3) of the faces at rest. The light was told
    apart from the colours on the normals that frames showed; on others it is a guess that can leave all that was seen. Where a
    colour cannot be within both, it is so in the light.
    """
    held = np.clip(gaussians.rgb[poor], gaussians.rgb[near].min(1), gaussians.rgb[near].max(1))
    if gaussians.light is None:
        return held
    factor = shade(gaussians.light, normals[gaussians.face])
    lit = gaussians.rgb * factor
    return np.clip(np.clip(held * factor[poor], lit[near].min(1), lit[near].max(1)) / factor[poor], 0, 1).astype(np.float32)


def level_heights(gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> Gaussians:
    """The gaussians, moved to within STEP (`SPARSE`: more) of the median height around them. rest: (V, 3) m; faces: (F, 3).

    One whose standard deviation along the face's normal is larger than that shrinks to it.
    """
    step = STEP * max(1, SPARSE / max(len(gaussians), 1)) ** 0.5
    frames = face_frames(rest, faces)
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
