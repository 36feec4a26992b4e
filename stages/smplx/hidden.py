"""What the camera does not see of the person: outside the picture, or behind something that stands still, furniture or a pole.

Such a thing is where the mask never is although the person's limbs are. Points there are guesses of the detector, and so are those
outside the picture: they lie too near to what is seen, and pull the rest of the body with them.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.stages.findings import Code, Finding
from gsac.stages.frame_names import name_frames
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.silhouette import Outline

DEEP = 0.015
"""Distance from where the person is ever seen, as a share of the person's height, from which on a point lies behind something; on
clips of whole persons one point in thousands does."""
LEAST_FRAMES = 0.1
"""Share of the frames, and three at least, that must have such a point: one may be an error."""
LIMB, REACH = 0.02, 0.06
"""Shares of the height: half the width of a limb, and how far the thing may reach beyond its middle line."""
OFTEN = 0.1
"""Share of the frames in which a limb must cross a pixel."""
GUESS = 0.03
"""Depth, as a share of the height, from which on a point is a guess that counts for nothing; before that its sigma grows."""
GROWTH = 2.0
"""Growth of sigma, per px of depth."""
LIMBS = [[INDEX[name] for name in pair.split()] for pair in (
    "left_shoulder right_shoulder", "left_hip right_hip", "left_shoulder left_hip", "right_shoulder right_hip",
    "left_shoulder right_hip", "right_shoulder left_hip", "left_hip left_knee", "right_hip right_knee",
    "left_knee left_ankle", "right_knee right_ankle", "left_ankle left_big_toe", "right_ankle right_big_toe",
    "left_shoulder left_elbow", "right_shoulder right_elbow", "left_elbow left_wrist", "right_elbow right_wrist")]
NECK = [INDEX[name] for name in ("nose", "left_shoulder", "right_shoulder")]
TRUNK_AND_LIMBS = slice(5, 23)
PARTS = {"the head": [*range(5), *range(FACE.start, FACE.stop)], "the shoulders": [5, 6], "the elbows": [7, 8],
         "the left hand": [9, *range(HANDS["left"].start, HANDS["left"].stop)],
         "the right hand": [10, *range(HANDS["right"].start, HANDS["right"].stop)],
         "the hips": [11, 12], "the knees": [13, 14], "the feet": [*range(15, 23)]}
"""What a warning calls points."""


def leave_out_outside(sightings: Sightings) -> Sightings:
    """Sightings in which no point outside the picture counts."""
    inside = ((sightings.xy >= 0) & (sightings.xy < (sightings.width, sightings.height))).all(-1)
    return replace(sightings, score=np.where(inside, sightings.score, 0))


def find_occluder(sightings: Sightings, outlines: list[Outline]) -> np.ndarray | None:
    """(h, w) bool, where something that stands still hides the person, at the size of the outlines; None where nothing does."""
    shown = np.any([outline.mask for outline in outlines], axis=0)
    if not shown.any():
        return None
    scale, height = outlines[0].scale, _height(outlines)
    depth = _depth(shown) * scale
    points, seen = sightings.xy[:, TRUNK_AND_LIMBS], sightings.seen[:, TRUNK_AND_LIMBS]
    deep = seen & (_at(depth, points, scale) > DEEP * height)
    if deep.any(1).sum() < max(3, LEAST_FRAMES * len(deep)):
        return None
    crossed = np.sum([_draw_limbs(xy, seen, shown.shape, scale, LIMB * height)
                      for xy, seen in zip(sightings.xy, sightings.seen, strict=True)], axis=0)
    behind = ~shown & (crossed >= max(2, OFTEN * len(deep)))
    count, label = cv2.connectedComponents(behind.astype(np.uint8))
    kept = np.isin(label, [part for part in range(1, count) if depth[label == part].max() > DEEP * height])
    if not kept.any():
        return None
    lowest = np.flatnonzero(shown.any(1))[-1]
    if kept[lowest + 1:].any():
        kept[lowest + 1:] = True  # legs may stand anywhere below what is ever shown
    return _grow(kept, ~shown, round(REACH * height / scale))


def hide(sightings: Sightings, occluder: np.ndarray, scale: float) -> tuple[Sightings, np.ndarray]:
    """Sightings in which a point behind the occluder counts less or not at all, and (T, 133) bool, those points.

    occluder: (h, w) bool, as `find_occluder` has it; scale: px of the frame per pixel of it.
    """
    height = sightings.person_height
    depth = _at(_depth(~occluder) * scale, sightings.xy, scale)
    score = np.where(depth > GUESS * height, 0, sightings.score)
    sigma = np.hypot(sightings.sigma, GROWTH * depth)
    return replace(sightings, score=score, sigma=sigma), (sightings.score > 0) & (depth > DEEP * height)


def describe_hidden(behind: np.ndarray) -> list[Finding]:
    """behind: (T, 133) bool, points behind something."""
    parts = {part: np.any(behind[:, points], axis=1) for part, points in PARTS.items()}
    named = ", ".join(f"{part} in {name_frames(frames)}" for part, frames in parts.items() if frames.any())
    frames = np.any(behind, axis=1)
    return [Finding.of(Code.PART_HIDDEN, frames, figure=int(frames.sum()), parts=named)] if named else []


def _height(outlines: list[Outline]) -> float:
    """Median height of the masks, px."""
    return float(np.median([np.ptp(np.flatnonzero(o.mask.any(1))) for o in outlines if o.area > 0]) * outlines[0].scale)


def _depth(free: np.ndarray) -> np.ndarray:
    """(h, w) distance to the next pixel that is free, in pixels. free: (h, w) bool."""
    return cv2.distanceTransform((~free).astype(np.uint8), cv2.DIST_L2, 5)


def _at(image: np.ndarray, xy: np.ndarray, scale: float) -> np.ndarray:
    """(...) values of an image (h, w) at points xy (..., 2) px of the frame; 0 outside. scale: px of the frame per pixel."""
    at = np.floor(np.nan_to_num(xy, nan=-1) / scale).astype(int)
    h, w = image.shape
    inside = (at >= 0).all(-1) & (at[..., 0] < w) & (at[..., 1] < h)
    at = np.clip(at, 0, [w - 1, h - 1])
    return np.where(inside, image[at[..., 1], at[..., 0]], 0)


def _draw_limbs(xy: np.ndarray, seen: np.ndarray, shape: tuple[int, int], scale: float, radius: float) -> np.ndarray:
    """(h, w) uint8, 1 where limbs between seen points lie, and the neck. xy: (133, 2) px; seen: (133,); radius: px."""
    out = np.zeros(shape, np.uint8)
    ends = [(xy[a], xy[b]) for a, b in LIMBS if seen[a] and seen[b]]
    if seen[NECK].all():
        ends.append((xy[NECK[0]], xy[NECK[1:]].mean(0)))
    for start, end in np.clip(np.array(ends) / scale, -1e4, 1e4).astype(int).tolist():
        cv2.line(out, start, end, 1, max(1, round(2 * radius / scale)))
    return out


def _grow(mask: np.ndarray, free: np.ndarray, steps: int) -> np.ndarray:
    """(h, w) bool, what of `free` (h, w) can be reached from the mask (h, w) in so many steps of a pixel, without leaving it."""
    out, within = mask.astype(np.uint8), free.astype(np.uint8)
    for _ in range(steps):
        out = np.minimum(cv2.dilate(out, np.ones((3, 3), np.uint8)), within)
    return out > 0
