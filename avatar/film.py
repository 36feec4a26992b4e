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
"""The picture's size over the figure's."""
FOLLOW_S = 0.6
"""Standard deviation, s, of the smoothing of the pelvis' place that the camera follows."""
SHADOW_RADIUS, SHADOW_STRENGTH = 0.3, 0.4
"""Of the soft shadow: its radius as a share of the figure's height, and how dark its middle is; as the viewer's."""
SAMPLES = 40
"""Frames whose bounds set the camera's distance."""


@dataclass
class Film:
    """A pose, a place and a camera angle for each frame."""

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
    """The A-pose, seen by a camera that goes around it once."""
    T = max(1, round(seconds * fps))
    pose = np.tile(avatar.pose("A" if "A" in avatar.poses else next(iter(avatar.poses))), (T, 1, 1))
    return Film(pose, np.zeros((T, 3), np.float32), np.arange(T) * 360.0 / T, fps)


def performance(motion: Motion, fps: float, seconds: float | None = None, yaw: float = 0.0) -> Film:
    """The first `seconds` of a motion, all of it unless given, at `fps` frames a second, seen from `yaw`, degrees."""
    length = motion.seconds if seconds is None else min(seconds, motion.seconds)
    T = max(1, math.floor(length * fps + 1e-6) + 1)
    pose, transl = zip(*(motion.at(t / fps) for t in range(T)), strict=True)
    return Film(np.stack(pose), np.stack(transl), np.full(T, yaw), fps)


def draw_frames(avatar: RiggedAvatar, film: Film, width: int, height: int, background: np.ndarray | None,
                workspace: Workspace | None = None, shadow: bool = False) -> Iterator[np.ndarray]:
    """Draws a film frame by frame: (height, width, 3) uint8 RGB each. background: (3,) RGB in 0..1.

    Without a background (height, width, 4): RGB and straight alpha. shadow: whether the figure has a soft one on the floor.
    """
    lit, gaussians, workspace = avatar.gaussians, replace(avatar.gaussians, light=None), workspace or Workspace()
    place = smooth_places(film.transl + avatar.joints[0], film.fps)
    focal = height / 2 / math.tan(math.radians(FOV / 2))
    camera = Camera((focal, focal), (width / 2, height / 2), width, height)
    middle, distance = fit_camera(avatar, film, place, width / height)
    for t in range(len(film)):
        vertices = avatar.posed(film.pose[t]) + film.transl[t]
        R, eye = look_at(film.yaw[t], place[t] * (1, 0, 1) + (0, middle, 0), distance)
        if lit.light is not None:  # the room's light stands in the avatar's axes, not in this camera's
            gaussians.rgb = lit.rgb * shade(lit.light, face_frames(vertices, avatar.faces).R[lit.face, :, 1])
        out = render_bound(((vertices - eye) @ R.T).astype(np.float32), avatar.faces, gaussians, camera, workspace)
        dark = cast_shadow(avatar, film.transl[t], R, eye, camera)[..., None] if shadow else 0.0
        behind = (1 - out.alpha[..., None]) * (1 - dark)
        if background is None:
            image = np.concatenate([out.rgb / np.maximum(1 - behind, 1e-6), 1 - behind], -1)
        else:
            image = out.rgb + behind * background
        yield np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def cast_shadow(avatar: RiggedAvatar, transl: np.ndarray, R: np.ndarray, eye: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) share of light that a soft round shadow below the figure takes, as in the viewer. transl: (3,) m; R (3, 3) and
    eye (3,), m: the camera's place in the world."""
    low, high = avatar.vertices.min(0), avatar.vertices.max(0)
    radius = SHADOW_RADIUS * (high[1] - low[1])
    x, y = np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5
    across, down = (x - camera.center[0]) / camera.focal[0], (y - camera.center[1]) / camera.focal[1]
    fall = down * R[1, 1] + R[2, 1]  # the camera does not roll, so a row of pixels falls alike
    far = np.where(fall < -1e-6, (avatar.ground - eye[1]) / np.minimum(fall, -1e-6), np.inf)
    reached = np.isfinite(far)
    out = np.zeros((camera.height, camera.width))
    rays = across[None, :, None] * R[0] + down[reached, None, None] * R[1] + R[2]
    ground = eye + far[reached, None, None] * rays
    middle = (low + high) / 2 + transl
    share = np.minimum(np.hypot(ground[..., 0] - middle[0], ground[..., 2] - middle[2]) / radius, 1)
    out[reached] = SHADOW_STRENGTH * ((1 - share) ** 2 * (1 + 2 * share)) ** 2
    return out


def smooth_places(places: np.ndarray, fps: float) -> np.ndarray:
    """(T, 3) m: places (T, 3) smoothed over time, by FOLLOW_S."""
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(places.astype(float), FOLLOW_S * fps, axis=0, mode="nearest")


def fit_camera(avatar: RiggedAvatar, film: Film, place: np.ndarray, aspect: float) -> tuple[float, float]:
    """Height of the camera's target and its distance from there, m, with which every pose of the film is inside the picture.

    place: (T, 3) m, the smoothed places that the camera follows; aspect: width over height.
    """
    sampled = np.unique(np.linspace(0, len(film) - 1, SAMPLES).astype(int))
    body = [avatar.posed(film.pose[t]) + film.transl[t] for t in sampled]
    middle = (min(v[:, 1].min() for v in body) + max(v[:, 1].max() for v in body)) / 2
    half = math.tan(math.radians(FOV / 2)) / ROOM
    distance = 0.0
    for t, vertices in zip(sampled, body, strict=True):
        R, target = look_at(film.yaw[t], place[t] * (1, 0, 1) + (0, middle, 0), 0.0)
        x, y, z = ((vertices - target) @ R.T).T
        distance = max(distance, (np.maximum(np.abs(x) / aspect, np.abs(y)) / half - z).max())
    return middle, distance


def look_at(yaw: float, target: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) from world to camera, OpenCV axes, and the eye (3,), m, of a camera that looks at `target` (3,), m.

    yaw: degrees, 0 sees the front; distance: m.
    """
    y, p = math.radians(yaw), math.radians(PITCH)
    back = np.array([math.sin(y) * math.cos(p), math.sin(p), math.cos(y) * math.cos(p)])
    right = np.array([math.cos(y), 0, -math.sin(y)])
    return np.stack([right, np.cross(-back, right), -back]), target + distance * back
