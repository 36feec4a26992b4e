"""Faults of the picture's frame: parts cut off, a person who leaves, is far away, turns the back, or is not there."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from gsac.benchmarks.stability.fault import Fault, pick_some
from gsac.benchmarks.stability.take import Take

LEAST_FRAMES = 3
"""Frames that are left of the person's back, at least."""
RIM = 3
"""px about the mask that may still show the person."""
Touched = tuple[Take, np.ndarray]
"""A take, and the frames (T,) bool that were touched."""


def cut_head(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the person's height above the picture."""
    box = take.boxes()
    row = (box[:, 1] + share * (box[:, 3] - box[:, 1])).mean()
    return _aim(take, np.tile([0, _angle(take, 1, 0) - _angle(take, 1, row)], (len(box), 1)))


def cut_feet(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the person's height below the picture."""
    box = take.boxes()
    row = (box[:, 3] - share * (box[:, 3] - box[:, 1])).mean()
    return _aim(take, np.tile([0, _angle(take, 1, take.size[0]) - _angle(take, 1, row)], (len(box), 1)))


def leave(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the clip, its end, in which the person walks out of the picture."""
    count = max(2, round(share * len(take.frames)))
    away = np.zeros((len(take.frames), 2))
    last = _angle(take, 0, take.size[1]) - _angle(take, 0, take.boxes()[-count:, 0].min())
    away[-count:, 0] = np.linspace(0, 1, count + 1)[1:] * last
    out, touched = _aim(take, away)
    return replace(out, asked=take.asked & out.masks.any((1, 2))), touched


def step_back(take: Take, factor: float, rng: np.random.Generator) -> Touched:
    """factor: on the person's size; the scene's edge goes on to the picture's."""
    height, width = take.size
    zoom = np.array([[factor, 0, (1 - factor) * width / 2], [0, factor, (1 - factor) * height / 2]])
    frames = [cv2.warpAffine(f, zoom, (width, height), flags=cv2.INTER_AREA, borderMode=cv2.BORDER_REPLICATE) for f in take.frames]
    masks = [cv2.warpAffine(m.astype(np.uint8), zoom, (width, height)) > 0 for m in take.masks]
    return replace(take, frames=np.stack(frames), masks=np.stack(masks)), np.ones(len(frames), bool)


def empty_scene(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the pictures, which show the scene without the person."""
    gone = pick_some(len(take.frames), share, rng)
    frames, masks = take.frames.copy(), take.masks.copy()
    frames[gone], masks[gone] = paint_scene(take), False
    return replace(take, frames=frames, masks=masks, asked=take.asked & ~gone), gone


def show_back(take: Take, degrees: float, rng: np.random.Generator) -> Touched:
    """degrees: of the turn, about the view from the front, that the clip leaves out."""
    front = np.abs((take.yaw + np.pi) % (2 * np.pi) - np.pi)
    kept = np.sort(np.argsort(-front)[:max(LEAST_FRAMES, (front >= np.radians(degrees / 2)).sum())])
    return take.at(kept), np.ones(len(kept), bool)


def paint_scene(take: Take) -> np.ndarray:
    """The scene without the person, (H, W, 3) uint8: each pixel's median over frames in which it is free. What never is goes on
    from around it: nothing of the person is left there.
    """
    rim = np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)
    frames = take.frames.astype(np.float32)
    frames[np.stack([cv2.dilate(mask.astype(np.uint8), rim) > 0 for mask in take.masks])] = np.nan
    unseen = np.isnan(frames[..., 0]).all(0)
    frames[0][unseen] = 0
    scene = np.nanmedian(frames, axis=0).round().astype(np.uint8)
    return cv2.inpaint(scene, np.asarray(unseen, np.uint8), RIM, cv2.INPAINT_TELEA)


def _angle(take: Take, axis: int, pixel: float) -> float:
    """rad, from the line of sight to the ray of a column (axis 0) or a row (axis 1)."""
    return float(np.arctan2(pixel - take.camera[axis, 2], take.camera[axis, axis]))


def _aim(take: Take, by: np.ndarray) -> Touched:
    """The take of a camera that is aimed elsewhere; the truth turns with the picture.

    To move the picture instead would be a lens that no phone has: the person would lean, by 17 degrees in the worst clip.
    by: (T, 2) rad, of the rays to the right and down.
    """
    size, camera = take.size[::-1], take.camera
    turn = Rotation.from_euler("yx", by * (1, -1)).as_matrix()
    ways = camera @ turn @ np.linalg.inv(camera)
    frames = [cv2.warpPerspective(f, m, size, borderMode=cv2.BORDER_REPLICATE) for f, m in zip(take.frames, ways, strict=True)]
    masks = [cv2.warpPerspective(f.astype(np.uint8), m, size) > 0 for f, m in zip(take.masks, ways, strict=True)]
    points = np.stack([cv2.perspectiveTransform(p[None], m)[0] for p, m in zip(take.points.astype(np.float64), ways, strict=True)])
    out = replace(take, frames=np.stack(frames), masks=np.stack(masks), points=points, rotation=turn @ take.rotation)
    return out, (by != 0).any(1)


FAULTS = (
    Fault("head-cut", "share of the person's height above the picture", (0.05, 0.1, 0.14, 0.2, 0.3), cut_head),
    Fault("feet-cut", "share of the person's height below the picture", (0.06, 0.1, 0.16, 0.25, 0.4), cut_feet),
    Fault("leaves", "share of the clip in which the person walks out", (0.1, 0.2, 0.3, 0.45, 0.6), leave),
    Fault("far-away", "factor on the person's size", (0.8, 0.6, 0.45, 0.3, 0.2), step_back),
    Fault("back-only", "degrees of the turn that are left out, about the front", (60, 120, 180, 220, 280), show_back),
    Fault("no-person", "share of pictures without a person", (0.2, 0.5, 0.8, 0.9, 1.0), empty_scene),
)
