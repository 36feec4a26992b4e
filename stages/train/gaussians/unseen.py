"""Gaussians that no frame shows from their front: laid on the surface that their neighbours make, in their neighbours' colour.

Nothing in the images says where they belong, and training would leave them as fur at edges and ragged soles. What is shown from one
side only says nothing of its depth either: no gaussian may stand off the surface that those around it make.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import FLATNESS, Gaussians
from gsac.avatar.raster import render_backward, render_bound
from gsac.avatar.threads import Workspace

BEHIND, FRONT = -0.2, 0.3
"""Cosine between a face's normal and the way to the camera: up to the first a frame shows nothing of it, from the second on all.
The first is below zero, since a limb's outline is made by what lies just behind its edge."""
LEAST_SHOWN = 0.05
"""Pixels of a half-size frame, on average over the frames, that a gaussian must show of its front to be called seen."""
LEAST_SHARE = 0.15
"""The same in pixels for its size, of what half of the seen ones show: in armpits frames show less, and at a slant."""
NEIGHBOURS = 8
AROUND, STEP = 24, 0.02
"""How many gaussians tell the surface's height at a place, and m that one may lie above or below it."""
SPARSE = 3000
"""Gaussians of an avatar below which these m grow with the way from one to the next: shrunk, they would leave holes."""


def shown(gaussians: Gaussians, vertices: np.ndarray, faces: np.ndarray, camera: Camera, workspace: Workspace) -> np.ndarray:
    """(N,) pixels that each gaussian adds to one image from its front. vertices: (V, 3).

    What it adds to all pixels is the gradient of their sum with respect to its colour.
    """
    rendering = render_bound(vertices, faces, gaussians, camera, workspace)
    added = render_backward(rendering.state, np.ones_like(rendering.rgb), np.zeros_like(rendering.alpha)).rgb[:, 0]
    frames = face_frames(vertices, faces)
    normal, place = frames.R[gaussians.face, :, 1], frames.T[gaussians.face]
    facing = -(normal * place).sum(1) / np.maximum(np.linalg.norm(place, axis=1), 1e-9)
    return np.clip((facing - BEHIND) / (FRONT - BEHIND), 0, 1) * added


def enough(pixels: np.ndarray, gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N,) bool, whether gaussians are seen. pixels: (N,) that each shows of its front, mean over the frames; rest: (V, 3) m."""
    bound = bind(face_frames(rest, faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    share = pixels / np.maximum(np.sort(bound.scales, 1)[:, 1:].prod(1), 1e-12)
    seen = pixels > LEAST_SHOWN
    return seen & (share > LEAST_SHARE * np.median(share[seen])) if seen.any() else seen


def laid(gaussians: Gaussians, seen: np.ndarray, rest: np.ndarray, faces: np.ndarray) -> Gaussians:
    """The gaussians, unseen ones as flat discs in the colour of their neighbours. seen: (N,) bool; rest: (V, 3) m.

    They lie no higher over the body than their neighbours and are no larger; opacity stays: the masks have told where nothing is.
    """
    poor = np.flatnonzero(~seen)
    if not len(poor) or not seen.any():
        return gaussians
    frames = face_frames(rest, faces)
    size, middle = np.maximum(frames.k[gaussians.face], 1e-9), frames.T[gaussians.face]
    count = min(NEIGHBOURS, int(seen.sum()))
    near = np.flatnonzero(seen)[cKDTree(middle[seen]).query(middle[poor], k=count)[1]].reshape(len(poor), count)
    out = gaussians[np.arange(len(gaussians))]
    height = np.median(size[near] * gaussians.mu[near, 1], axis=1) / size[poor]
    out.mu[poor, 1] = np.minimum(gaussians.mu[poor, 1], height)
    widths = np.sort(gaussians.log_scale, 1)[:, 1:].mean(1) + np.log(size)
    width = np.minimum(np.median(widths[near], axis=1), widths[poor]) - np.log(size[poor])
    out.log_scale[poor] = np.stack([width, width + np.log(FLATNESS), width], 1)
    out.quat[poor] = [1, 0, 0, 0]
    out.rgb[poor] = gaussians.rgb[near].mean(1)
    return out


def levelled(gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> Gaussians:
    """The gaussians, none of them more than STEP (few: `SPARSE`) above or below the middle height around it. rest: (V, 3) m.

    Neither is one thicker than that, measured along the face's normal as a standard deviation: it shrinks.
    """
    step = STEP * max(1, SPARSE / max(len(gaussians), 1)) ** 0.5
    frames = face_frames(rest, faces)
    size, middle = np.maximum(frames.k[gaussians.face], 1e-9), frames.T[gaussians.face]
    near = cKDTree(middle).query(middle, k=min(AROUND, len(gaussians)))[1].reshape(len(gaussians), -1)
    height = size * gaussians.mu[:, 1]
    usual = np.median(height[near], axis=1)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    axes = np.einsum("ni,nij->nj", frames.R[gaussians.face, :, 1], bound.rotations) * bound.scales
    out = gaussians[np.arange(len(gaussians))]
    out.mu[:, 1] = np.clip(height, usual - step, usual + step) / size
    out.log_scale += np.minimum(0, np.log(step / np.maximum(np.linalg.norm(axes, axis=1), 1e-9)))[:, None].astype(np.float32)
    return out
