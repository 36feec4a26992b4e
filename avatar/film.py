"""Frames of a moving avatar, drawn by the trainer's own rasteriser."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.light import shade
from gsac.avatar.motion.source import Motion
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace

FOV = 30.0
"""Degrees from top to bottom, as the viewer's."""
PITCH = 4.0
"""Degrees that the camera looks down."""
ROOM = 1.12
"""How much larger than the figure the picture is."""
FOLLOW_S = 0.6
"""The camera goes after the pelvis as its place smoothed by so many seconds (standard deviation)."""
LOOKS = 40
"""Frames whose bounds set the camera's distance."""


@dataclass
class Film:
    """What is to be drawn: one pose, place and camera angle a frame."""

    pose: np.ndarray
    """(T, J, 3) axis-angle."""
    transl: np.ndarray
    """(T, 3) m."""
    yaw: np.ndarray
    """(T,) degrees of the camera about the figure."""
    fps: float

    def __len__(self) -> int:
        return len(self.pose)


def turntable(avatar: RiggedAvatar, seconds: float, fps: float) -> Film:
    """The A-pose, and the camera once around it."""
    T = max(1, round(seconds * fps))
    pose = np.tile(avatar.pose("A" if "A" in avatar.poses else next(iter(avatar.poses))), (T, 1, 1))
    return Film(pose, np.zeros((T, 3), np.float32), np.arange(T) * 360.0 / T, fps)


def performance(motion: Motion, fps: float, seconds: float | None = None) -> Film:
    """The motion at `fps` frames a second, the first `seconds` of it."""
    length = motion.seconds if seconds is None else min(seconds, motion.seconds)
    T = max(1, math.floor(length * fps + 1e-6) + 1)
    pose, transl = zip(*(motion.at(t / fps) for t in range(T)), strict=True)
    return Film(np.stack(pose), np.stack(transl), np.zeros(T), fps)


def frames(avatar: RiggedAvatar, film: Film, width: int, height: int, background: np.ndarray,
           workspace: Workspace | None = None) -> Iterator[np.ndarray]:
    """(height, width, 3) uint8 RGB, one by one; background: (3,) in 0..1."""
    lit, gaussians, workspace = avatar.gaussians, replace(avatar.gaussians, light=None), workspace or Workspace()
    place = followed(film.transl + avatar.joints[0], film.fps)
    focal = height / 2 / math.tan(math.radians(FOV / 2))
    camera = Camera((focal, focal), (width / 2, height / 2), width, height)
    middle, distance = framing(avatar, film, place, width / height)
    for t in range(len(film)):
        vertices = avatar.posed(film.pose[t]) + film.transl[t]
        R, eye = look(film.yaw[t], place[t] * (1, 0, 1) + (0, middle, 0), distance)
        if lit.light is not None:  # the room's light stands in the avatar's axes, not in this camera's
            gaussians.rgb = lit.rgb * shade(lit.light, face_frames(vertices, avatar.faces).R[lit.face, :, 1])
        out = render_bound(((vertices - eye) @ R.T).astype(np.float32), avatar.faces, gaussians, camera, workspace)
        image = out.rgb + (1 - out.alpha[..., None]) * background
        yield np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def followed(place: np.ndarray, fps: float) -> np.ndarray:
    """(T, 3) smoothed over time."""
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(place.astype(float), FOLLOW_S * fps, axis=0, mode="nearest")


def framing(avatar: RiggedAvatar, film: Film, place: np.ndarray, aspect: float) -> tuple[float, float]:
    """Height of the point that the camera looks at, and its distance from there, m: all the film's poses are inside."""
    looked = np.unique(np.linspace(0, len(film) - 1, LOOKS).astype(int))
    body = [avatar.posed(film.pose[t]) + film.transl[t] for t in looked]
    middle = (min(v[:, 1].min() for v in body) + max(v[:, 1].max() for v in body)) / 2
    half = math.tan(math.radians(FOV / 2)) / ROOM
    distance = 0.0
    for t, vertices in zip(looked, body, strict=True):
        R, target = look(film.yaw[t], place[t] * (1, 0, 1) + (0, middle, 0), 0.0)
        x, y, z = ((vertices - target) @ R.T).T
        distance = max(distance, (np.maximum(np.abs(x) / aspect, np.abs(y)) / half - z).max())
    return middle, distance


def look(yaw: float, target: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """World to camera (3, 3), OpenCV axes, and the eye (3,); yaw 0 sees the front."""
    y, p = math.radians(yaw), math.radians(PITCH)
    back = np.array([math.sin(y) * math.cos(p), math.sin(p), math.cos(y) * math.cos(p)])
    right = np.array([math.cos(y), 0, -math.sin(y)])
    return np.stack([right, np.cross(-back, right), -back]), target + distance * back
