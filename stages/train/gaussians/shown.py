"""What the frames show of each gaussian, and of the place where it lies."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import FaceFrames, bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
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
AROUND = 24
"""Gaussians that make up a place."""
FACING = 0.3
"""Cosine between the normals of two gaussians above which one tells how well the frames show the other's place."""


def front_pixels(gaussians: Gaussians, vertices: np.ndarray, faces: np.ndarray, camera: Camera,
                 workspace: Workspace) -> np.ndarray:
    """(N,) pixels that each gaussian adds to one image from its front. vertices: (V, 3) m, camera frame; faces: (F, 3)."""
    added = added_alpha(render_bound(vertices, faces, gaussians, camera, workspace))
    frames = face_frames(vertices, faces)
    normal, place = frames.R[gaussians.face, :, 1], frames.T[gaussians.face]
    facing = -(normal * place).sum(1) / np.maximum(np.linalg.norm(place, axis=1), 1e-9)
    return np.clip((facing - BEHIND) / (FRONT - BEHIND), 0, 1) * added


def find_seen(pixels: np.ndarray, gaussians: Gaussians, frames: FaceFrames) -> np.ndarray:
    """(N,) bool, whether gaussians are seen.

    pixels: (N,) `front_pixels`, mean over the clip's frames; frames: of all faces at rest.
    """
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    share = pixels / divisible_areas(bound)
    seen = pixels > LEAST_SHOWN
    return seen & (share > LEAST_SHARE * np.median(share[seen])) if seen.any() else seen


def find_place(means: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, K) gaussians nearest to each, itself the first, and (N, K) the cosines between their normals and its own.

    means: (N, 3) m; normals: (N, 3) of the faces; both at rest.
    """
    near = find_nearest(means, means, AROUND)
    return near, np.einsum("nki,ni->nk", normals[near], normals)


def find_evidence(pixels: np.ndarray, areas: np.ndarray, seen: np.ndarray, near: np.ndarray, alike: np.ndarray) -> np.ndarray:
    """(N,) how well the frames show each gaussian's place: pixels per area there, over the median of the seen.

    pixels: (N,) `front_pixels`; areas: (N,) m2; seen: (N,) bool; near: (N, K) gaussians at the place; alike: (N, K) cosine
    between their normals and its own.
    """
    facing = alike > FACING
    shown = (pixels[near] * facing).sum(1) / np.maximum((areas[near] * facing).sum(1), 1e-12)
    return shown / max(float(np.median(shown[seen])), 1e-12)
