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
ROOM = 1.08
"""The picture's size over the figure's."""
FOLLOW_S = 0.6
"""Standard deviation, s, of the smoothing of the pelvis' place that the camera follows."""
FRAMING_S = 1.0
"""The camera comes nearer and rises no faster than this: whatever is seen within it before and after is in the picture too."""
SHADOW_RADIUS, SHADOW_STRENGTH = 0.3, 0.4
"""Of the soft shadow: its radius as a share of the figure's height, and how dark its middle is; as the viewer's."""
FLOOR_RADIUS, FLOOR_SOLID = 2.2, 0.3
"""Of the floor: where it ends, in heights of the figure, and the share of that from which on it fades out."""
FLOOR_LINE, FLOOR_STEP, FLOOR_INK = 0.012, 0.5, 0.14
"""Of the floor's lines: width and distance, m, and how much darker they are, or lighter on a dark floor."""


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
    """The A-pose, or the T-pose where the avatar has no A, as in the viewer, seen by a camera that goes around it once."""
    T = max(1, round(seconds * fps))
    name = next((name for name in ("A", "T") if name in avatar.poses), None)
    still = np.zeros((len(avatar.joints), 3), np.float32) if name is None else avatar.pose(name)  # no turns are the T-pose
    pose = np.tile(still, (T, 1, 1))
    return Film(pose, np.zeros((T, 3), np.float32), np.arange(T) * 360.0 / T, fps)


def performance(motion: Motion, fps: float, seconds: float | None = None, yaw: float = 0.0) -> Film:
    """The first `seconds` of a motion, all of it unless given, at `fps` frames a second, seen from `yaw`, degrees."""
    length = motion.seconds if seconds is None else min(seconds, motion.seconds)
    T = max(1, math.floor(length * fps + 1e-6) + 1)
    pose, transl = zip(*(motion.at(t / fps) for t in range(T)), strict=True)
    return Film(np.stack(pose), np.stack(transl), np.full(T, yaw), fps)


def draw_frames(avatar: RiggedAvatar, film: Film, width: int, height: int, background: np.ndarray | None,
                workspace: Workspace | None = None, shadow: bool = False, floor: np.ndarray | None = None) -> Iterator[np.ndarray]:
    """Draws a film frame by frame: (height, width, 3) uint8 RGB each. background: (3,) RGB in 0..1.

    Without a background (height, width, 4): RGB and straight alpha. shadow: whether the figure has a soft one on the floor;
    floor: (3,) RGB in 0..1 of the floor itself, if it is seen.
    """
    lit, gaussians, workspace = avatar.gaussians, replace(avatar.gaussians, light=None), workspace or Workspace()
    focal = height / 2 / math.tan(math.radians(FOV / 2))
    camera = Camera((focal, focal), (width / 2, height / 2), width, height)
    targets = find_targets(avatar, film)
    distances = find_distances(avatar, film, targets, width / height)
    for t in range(len(film)):
        vertices = avatar.posed(film.pose[t]) + film.transl[t]
        R, eye = look_at(film.yaw[t], targets[t], distances[t])
        if lit.light is not None:  # the room's light stands in the avatar's axes, not in this camera's
            gaussians.rgb = lit.rgb * shade(lit.light, face_frames(vertices, avatar.faces).R[lit.face, :, 1])
        out = render_bound(((vertices - eye) @ R.T).astype(np.float32), avatar.faces, gaussians, camera, workspace)
        image, left = out.rgb, 1 - out.alpha[..., None]
        if shadow or floor is not None:
            ground = see_ground(avatar.ground, R, eye, camera)
            if shadow:
                left = left * (1 - cast_shadow(avatar, film.transl[t], ground)[..., None])
            if floor is not None:
                colour, there = draw_floor(avatar, floor, targets[t], ground)
                image, left = image + left * there[..., None] * colour, left * (1 - there[..., None])
        if background is None:
            image = np.concatenate([image / np.maximum(1 - left, 1e-6), 1 - left], -1)
        else:
            image = image + left * background
        yield np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def see_ground(level: float, R: np.ndarray, eye: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W, 2) x and z, m, of the ground at y = `level` in each pixel, infinite above the horizon. R (3, 3) and eye (3,), m: the
    camera's place in the world."""
    x, y = np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5
    across, down = (x - camera.center[0]) / camera.focal[0], (y - camera.center[1]) / camera.focal[1]
    fall = down * R[1, 1] + R[2, 1]  # the camera does not roll, so a row of pixels falls alike
    reached = fall < -1e-6
    far = (level - eye[1]) / fall[reached, None, None]
    out = np.full((camera.height, camera.width, 2), np.inf)
    right, below, ahead = R[:, [0, 2]]
    out[reached] = eye[[0, 2]] + far * (across[None, :, None] * right + down[reached, None, None] * below + ahead)
    return out


def cast_shadow(avatar: RiggedAvatar, transl: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """(H, W) share of light that a soft round shadow below the figure takes, as in the viewer. transl: (3,) m; ground:
    (H, W, 2) m, as seen."""
    low, high = avatar.vertices.min(0), avatar.vertices.max(0)
    middle = (low + high) / 2 + transl
    share = np.minimum(np.hypot(*np.moveaxis(ground - middle[[0, 2]], -1, 0)) / (SHADOW_RADIUS * (high[1] - low[1])), 1)
    return SHADOW_STRENGTH * ((1 - share) ** 2 * (1 + 2 * share)) ** 2


def draw_floor(avatar: RiggedAvatar, colour: np.ndarray, target: np.ndarray, ground: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Colours (H, W, 3) of a floor with lines, and how much of it there is (H, W), which fades out around the camera's target.

    colour: (3,) RGB in 0..1; target: (3,) m; ground: (H, W, 2) m, as seen.
    """
    radius = FLOOR_RADIUS * np.ptp(avatar.vertices[:, 1])
    away = np.hypot(*np.moveaxis(ground - target[[0, 2]], -1, 0)) / radius
    share = np.clip((away - FLOOR_SOLID) / (1 - FLOOR_SOLID), 0, 1)
    there = (1 - share) ** 2 * (1 + 2 * share)
    rows = slice(min(int(np.argmax(there.any(1))), len(there) - 2), None)
    near = np.where(there[rows, :, None] > 0, ground[rows], 0)
    pixel = np.abs(np.gradient(near, axis=1)) + np.abs(np.gradient(near, axis=0)) + 1e-6
    covered = ((_lines_before(near + pixel / 2) - _lines_before(near - pixel / 2)) / pixel).max(-1)
    ink = np.full(3, 0.0 if colour.mean() > 0.5 else 1.0)
    out = np.broadcast_to(colour, (*there.shape, 3)).copy()
    out[rows] += (FLOOR_INK * covered)[..., None] * (ink - colour)
    return out, there


def _lines_before(place: np.ndarray) -> np.ndarray:
    """m of the way from 0 to a place, m, that lie in lines of the floor."""
    whole = np.floor(place / FLOOR_STEP)
    return whole * FLOOR_LINE + np.minimum(place - whole * FLOOR_STEP, FLOOR_LINE)


def smooth_places(places: np.ndarray, fps: float) -> np.ndarray:
    """(T, 3) m: places (T, 3) smoothed over time, by FOLLOW_S, as if they went on before and after as they begin and end."""
    from scipy.ndimage import gaussian_filter1d

    more = math.ceil(4 * FOLLOW_S * fps)
    longer = np.pad(places.astype(float), ((more, more), (0, 0)), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(longer, FOLLOW_S * fps, axis=0)[more:-more]


def find_targets(avatar: RiggedAvatar, film: Film) -> np.ndarray:
    """(T, 3) m: where the camera looks in each frame. It goes along with the pelvis, and rises and sinks with the figure."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    body = (avatar.posed(pose)[:, 1] + transl[1] for pose, transl in zip(film.pose, film.transl, strict=True))
    low, high = np.array([(y.min(), y.max()) for y in body]).T
    span = _framing_frames(film)
    out = smooth_places(film.transl + avatar.joints[0], film.fps)
    out[:, 1] = _even_out((minimum_filter1d(low, span, mode="nearest") + maximum_filter1d(high, span, mode="nearest")) / 2, span)
    return out


def find_distances(avatar: RiggedAvatar, film: Film, targets: np.ndarray, aspect: float) -> np.ndarray:
    """(T,) m from the targets, (T, 3) m, at which every pose is inside the picture. They change slowly, and not at all where the
    camera goes round.

    aspect: width over height.
    """
    from scipy.ndimage import maximum_filter1d

    half, span = math.tan(math.radians(FOV / 2)) / ROOM, _framing_frames(film)
    need = np.array([(np.maximum(np.abs(x) / aspect, np.abs(y)) / half - z).max() for x, y, z in _seen(avatar, film, targets)])
    if np.ptp(film.yaw):
        return np.full(len(film), need.max())
    return _even_out(maximum_filter1d(need, span, mode="nearest"), span)


def fit_aspect(avatar: RiggedAvatar, film: Film) -> float:
    """The least width over height of a picture that the figure fills from top to bottom, and that holds every pose."""
    half, targets = math.tan(math.radians(FOV / 2)) / ROOM, find_targets(avatar, film)
    distances = find_distances(avatar, film, targets, math.inf)
    seen = zip(_seen(avatar, film, targets), distances, strict=True)
    return max(float((np.abs(x) / half / (z + distance)).max()) for (x, _, z), distance in seen)


def _seen(avatar: RiggedAvatar, film: Film, targets: np.ndarray) -> Iterator[np.ndarray]:
    """The figure in each frame, (3, V) m, from a camera that stands in its target; targets: (T, 3) m."""
    for t in range(len(film)):
        R, target = look_at(film.yaw[t], targets[t], 0.0)
        yield ((avatar.posed(film.pose[t]) + film.transl[t] - target) @ R.T).T


def _framing_frames(film: Film) -> int:
    """Frames within FRAMING_S before and after one."""
    return 2 * round(FRAMING_S * film.fps) + 1


def _even_out(values: np.ndarray, span: int) -> np.ndarray:
    """(T,) means of values (T,) over `span` frames: of bounds over as many, which hold for each frame of the span."""
    from scipy.ndimage import uniform_filter1d

    return uniform_filter1d(values, span, mode="nearest")


def look_at(yaw: float, target: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) from world to camera, OpenCV axes, and the eye (3,), m, of a camera that looks at `target` (3,), m.

    yaw: degrees, 0 sees the front; distance: m.
    """
    y, p = math.radians(yaw), math.radians(PITCH)
    back = np.array([math.sin(y) * math.cos(p), math.sin(p), math.cos(y) * math.cos(p)])
    right = np.array([math.cos(y), 0, -math.sin(y)])
    return np.stack([right, np.cross(-back, right), -back]), target + distance * back
