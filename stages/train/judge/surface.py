"""How much of the body's surface the frames show, by area: a figure that the number of gaussians does not change."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.threads import side_by_side
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.turned_body import turn_before_camera
from gsac.stages.train.views import View

MOST = 24
"""Frames, at most, that are looked at."""
FACING = 0.4
"""Least cosine between a face's normal and the direction to the camera."""
SLACK = 0.02
"""m that a face may lie behind the nearest surface."""
TURNS = range(0, 360, 30)
"""Degrees of the views of a full turn."""
MASKED = 128
"""Least value of the mask, 0..255, where the person is."""
HEIGHT = 320
"""px of the images in which hidden faces are found."""


def seen_area(poses: Poses, frames: np.ndarray, views: list[View]) -> float:
    """Share, 0..1, of the surface that a full turn in T-pose can show, that some frames show: in the mask, not hidden or slanting.

    frames: (n,) indices.
    """
    faces = poses.body.faces
    rest = poses.rest(0)[0]
    corners = rest[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    chosen = frames[:: -(-len(frames) // MOST)].tolist()

    seen = np.any(side_by_side(lambda t, workspace: faces_in_view(poses.vertices(t), faces, views[t]), chosen), axis=0)
    outer = np.any(side_by_side(lambda turn, workspace: faces_before(*turn_before_camera(rest, turn)[:2], faces), TURNS), axis=0)
    return float(area[seen & outer].sum() / area[outer].sum())


def faces_in_view(vertices: np.ndarray, faces: np.ndarray, view: View) -> np.ndarray:
    """(F,) bool: `faces_before`, and the mask is there. vertices: (V, 3) m, camera frame; faces: (F, 3)."""
    whole, pixels = view.frame, view.pixels[..., 3]
    scale = min(1.0, HEIGHT / whole.height)
    shown = faces_before(vertices, whole.scaled(round(whole.width * scale) or 1, round(whole.height * scale) or 1), faces)
    places = vertices[faces[shown]].mean(1)
    at = np.clip(whole.project(places), 0, (whole.width - 1, whole.height - 1)).astype(int) - view.corner
    inside = ((at >= 0) & (at < pixels.shape[::-1])).all(1)
    x, y = np.where(inside, at.T, 0)
    shown[shown] = inside & (pixels[y, x] >= MASKED)
    return shown


def faces_before(vertices: np.ndarray, camera: Camera, faces: np.ndarray) -> np.ndarray:
    """(F,) bool: in the picture, turned to the camera, and not hidden. vertices: (V, 3) m, camera frame; faces: (F, 3)."""
    frames = face_frames(vertices, faces)
    facing = -(frames.R[:, :, 1] * frames.T).sum(1) / np.maximum(np.linalg.norm(frames.T, axis=1), 1e-9)
    return (facing > FACING) & visible_points(frames.T, rasterise(vertices, faces, camera)[2], camera, SLACK)
