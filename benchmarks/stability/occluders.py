"""Faults of the scene: furniture, poles, held things, mirrors and other people."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from gsac.benchmarks.stability.fault import Fault, pick_run
from gsac.benchmarks.stability.take import Take

WOOD, STEEL, RED = (116, 84, 58), (96, 100, 108), (178, 44, 40)
"""Colours of things."""
RIGHT_WRIST = 10
"""Among the body's points."""
Touched = tuple[Take, np.ndarray]
"""A take, and the frames (T,) bool that were touched."""


def put_furniture(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the person's height, from the soles up, behind it."""
    box = take.boxes()
    top = int((box[:, 3] - share * (box[:, 3] - box[:, 1])).mean())
    return _cover(take, slice(top, None), slice(None), WOOD, rng)


def put_chair(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the person's width, from the left, behind a thing as high as a third of the person."""
    box = take.boxes()
    left, right = box[:, 0].min(), box[:, 2].max()
    top = int((box[:, 3] - (box[:, 3] - box[:, 1]) / 3).mean())
    return _cover(take, slice(top, box[:, 3].max()), slice(left, int(left + share * (right - left))), WOOD, rng)


def put_pole(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the picture's width, before the person's middle."""
    middle, half = take.size[1] / 2 + rng.uniform(-0.01, 0.01) * take.size[1], share * take.size[1] / 2
    return _cover(take, slice(None), slice(int(middle - half), int(np.ceil(middle + half))), STEEL, rng)


def hold_thing(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: radius of a thing in the right hand, of the person's height; hidden where the hand is."""
    box, frames = take.boxes(), take.frames.copy()
    touched = take.masks[np.arange(len(frames)), *_pixels(take, RIGHT_WRIST)]
    for t in np.flatnonzero(touched):
        centre = tuple(int(c) for c in take.points[t, RIGHT_WRIST])
        cv2.circle(frames[t], centre, max(1, round(share * (box[t, 3] - box[t, 1]))), RED, -1, cv2.LINE_AA)
    return replace(take, frames=frames), touched


def add_second_person(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the clip in which another person stands beside, smaller."""
    some = pick_run(len(take.frames), share, rng)
    return _paste(take, some, np.full(len(some), 0.3 * take.size[1]), 0.75, 1.0)


def walk_through(take: Take, count: float, rng: np.random.Generator) -> Touched:
    """count: frames in which someone walks past, before the person."""
    some = pick_run(len(take.frames), count / len(take.frames), rng)
    at = np.zeros(len(some))
    at[some] = np.linspace(-0.7, 0.7, some.sum() + 2)[1:-1] * take.size[1]
    return _paste(take, some, at, 1.05, 1.0, before=True)


def hang_mirror(take: Take, factor: float, rng: np.random.Generator) -> Touched:
    """factor: size of the person's mirror image, at the left."""
    some = np.ones(len(take.frames), bool)
    return _paste(take, some, np.full(len(some), -0.32 * take.size[1]), factor, 0.85, source=np.arange(len(some)))


def _cover(take: Take, rows: slice, columns: slice, colour: tuple[int, int, int], rng: np.random.Generator) -> Touched:
    """The take behind a thing that stands still, with a little grain."""
    frames = take.frames.copy()
    shape = frames[0, rows, columns].shape
    frames[:, rows, columns] = np.clip(np.array(colour) + rng.normal(0, 5, shape), 0, 255).astype(np.uint8)
    return replace(take, frames=frames), np.any(take.masks[:, rows, columns], axis=(1, 2))


def _paste(take: Take, some: np.ndarray, by: np.ndarray, factor: float, opacity: float, before: bool = False,
           source: np.ndarray | None = None) -> Touched:
    """The take with the mirrored person of another frame pasted in.

    some: (T,) bool, frames; by: (T,) px to the side; factor: on the size; before: over the person, else behind;
    source: (T,) frame of each pasted person, by default half a clip away.
    """
    count, (height, width) = len(take.frames), take.size
    source = (np.arange(count) + count // 2) % count if source is None else source
    feet, frames = take.boxes()[:, 3].max(initial=0), take.frames.copy()
    for t in np.flatnonzero(some):
        turn = np.array([[-factor, 0, width / 2 * (1 + factor) + by[t]], [0, factor, feet * (1 - factor)]])
        other = cv2.warpAffine(take.frames[source[t]], turn, (width, height))
        seen = cv2.warpAffine(take.masks[source[t]].astype(np.uint8), turn, (width, height)) > 0
        seen &= before | ~take.masks[t]
        frames[t][seen] = (opacity * other[seen] + (1 - opacity) * frames[t][seen]).round()
    return replace(take, frames=frames), some


def _pixels(take: Take, point: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column (T,) of the pixel of a point of the body."""
    height, width = take.size
    x, y = np.nan_to_num(take.points[:, point]).astype(int).T
    return np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)


FAULTS = (
    Fault("furniture", "share of the person's height behind it, from the soles", (0.1, 0.15, 0.25, 0.35, 0.5), put_furniture),
    Fault("pole", "share of the picture's width, before the person", (0.01, 0.03, 0.05, 0.07, 0.12), put_pole),
    Fault("held-thing", "radius, share of the person's height, in the right hand", (0.02, 0.03, 0.045, 0.06, 0.09), hold_thing),
    Fault("chair", "share of the person's width behind it", (0.2, 0.35, 0.5, 0.75, 1.0), put_chair),
    Fault("second-person", "share of the clip with another person beside", (0.1, 0.2, 0.4, 0.7, 1.0), add_second_person),
    Fault("walk-through", "frames in which someone walks past before the person", (2, 4, 6, 9, 12), walk_through),
    Fault("mirror-in-room", "size of the mirror image beside the person", (0.3, 0.4, 0.5, 0.6, 0.8), hang_mirror),
)
