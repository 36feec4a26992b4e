"""Colours to start from, read off the frames; what no frame sees takes the colour of what lies beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.zbuffer import rasterise, visible_points
from scipy.spatial import cKDTree

LEAST_FACING = 0.1
"""Cosine between the face's normal and the ray to the camera below which a colour is not read."""
SURE = 200
"""Mask value (of 255) from which on a pixel shows the person alone."""


@dataclass
class PosedFrame:
    vertices: np.ndarray
    """(V, 3) m, camera frame."""
    camera: Camera
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""


def read_colours(frames: list[PosedFrame], faces: np.ndarray, gaussians: Gaussians) -> tuple[np.ndarray, np.ndarray]:
    """Mean colour of each gaussian's place over the frames that see it, straight views counting more.

    Returns rgb (N, 3) float32 in 0..1, grey where unseen, and seen (N,) bool.
    """
    total, weight = np.zeros((len(gaussians), 3)), np.zeros(len(gaussians))
    for frame in frames:
        posed = face_frames(frame.vertices, faces)
        places = bind(posed, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale).means.astype(np.float64)
        facing = -(posed.R[gaussians.face, :, 1] * places).sum(1) / np.maximum(np.linalg.norm(places, axis=1), 1e-9)
        depth = rasterise(frame.vertices, faces, frame.camera)[2]
        visible = np.flatnonzero(visible_points(places, depth, frame.camera) & (facing > LEAST_FACING))
        x, y = frame.camera.project(places[visible]).astype(np.int64).T
        pixel = frame.pixels[y, x].astype(np.float64)
        sure = pixel[:, 3] > SURE
        chosen, w = visible[sure], facing[visible[sure]] ** 2
        total[chosen] += w[:, None] * pixel[sure, :3] / pixel[sure, 3:]
        weight[chosen] += w
    seen = weight > 0
    rgb = np.full((len(seen), 3), 0.5, np.float32)
    rgb[seen] = np.clip(total[seen] / weight[seen, None], 0, 1)
    return rgb, seen


def fill_unseen(rgb: np.ndarray, seen: np.ndarray, places: np.ndarray) -> np.ndarray:
    """rgb (N, 3) with the unseen rows replaced by the mean of the 4 nearest seen ones; places: (N, 3) m at rest."""
    if seen.all() or not seen.any():
        return rgb
    out = rgb.copy()
    near = cKDTree(places[seen]).query(places[~seen], k=min(4, int(seen.sum())))[1]
    out[~seen] = rgb[seen][near.reshape(len(near), -1)].mean(1)
    return out
