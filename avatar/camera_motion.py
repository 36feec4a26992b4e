"""How far the camera moves: points of the background, found again frame after frame.

A plain wall has no points, and leaves in the wind, a screen or a person who walks by don't move as one: then it is unknown.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

LONGER = 400
"""px of the longer side at which points are found and followed."""
REACH = 0.03
"""Distance kept from the person, as a share of the longer side."""
EVEN = 6.0
"""px of the small picture beyond which brightness may change: flicker, automatic exposure, soft shadows."""
CORNER, PATCH, RIM = 5e-5, 7, 8
"""Least eigenvalue that makes a corner, size of what it is told by, and its distance from the frame's end (px)."""
CELLS, MOST_IN_CELL = 8, 4
"""The picture is cut into CELLS x CELLS, so that no thing in it holds most of the points."""
SEARCH = {"winSize": (15, 15), "maxLevel": 3, "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.03)}
BACK, AGREE = 0.5, 0.7
"""px by which a point that is followed there and back may miss itself, and by which points that move as one may differ."""
LEAST_POINTS, LEAST_SHARE, LEAST_CELLS, LEAST_SPAN = 12, 0.5, 8, 0.4
"""What must move as one: of how many points, which share, in how many cells, over which share of width and of height."""
LEAST_KNOWN = 0.5
"""Share of the frames that must be known."""
MOVED, LEAST_MOVED = 0.003, 2
"""Shares of the longer side from which on the camera has moved, and in how many frames at least: one may be an error."""


@dataclass
class View:
    """One frame, small, as points are followed in it."""

    grey: np.ndarray
    """(h, w) uint8, without slow changes of brightness."""
    free: np.ndarray
    """(h, w) bool: certainly not the person."""
    scale: float
    """Its px per px of the frame."""


def make_view(image: np.ndarray, alpha: np.ndarray) -> View:
    """image: (H, W, 3) uint8; alpha: (H, W) in 0..1."""
    scale = min(1.0, LONGER / max(image.shape[:2]))
    grey, person = (cv2.resize(x, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
                    for x in (cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), alpha))
    wide = 2 * int(np.ceil(REACH * max(grey.shape))) + 1
    fine = grey - cv2.GaussianBlur(grey.astype(np.float32), (0, 0), EVEN)
    return View(np.clip(fine + 128, 0, 255).astype(np.uint8),
                cv2.dilate((person > 0.05).astype(np.uint8), np.ones((wide, wide), np.uint8)) == 0, scale)


def measure_sway(views: Iterable[View]) -> np.ndarray:
    """Returns (T,) px, distance of the frame's background from its median place; NaN where that is unknown.

    A frame is compared with the first one, and from where that is out of sight with the last one that is known.
    """
    anchor = last = None
    places: list[np.ndarray] = []
    known = 0
    for view in views:
        found = chain(anchor, view)
        if found is None and last is not anchor:
            anchor = last
            found = chain(anchor, view)
        if found is not None:
            last = (view, found)
            known += 1
        elif known < 2:  # nothing goes on from the first one: a hand or the person was close before it
            places = [np.full((4, 2), np.nan)] * len(places)
            anchor = last = (view, found := np.eye(3))
            known = 1
        places.append(quarter_points(view, found))
    if known < max(2, LEAST_KNOWN * len(places)):
        return np.full(len(places), np.nan)
    return np.linalg.norm(places - np.nanmedian(places, axis=0), axis=2).mean(1)


def find_moved(sway: np.ndarray, longer: int) -> np.ndarray:
    """sway: (T,) px; longer: px of the frame's longer side. Returns (T,) bool, the frames in which the camera stood elsewhere."""
    moved = sway > MOVED * longer
    return moved & (moved.sum() >= LEAST_MOVED)


def chain(start: tuple[View, np.ndarray] | None, view: View) -> np.ndarray | None:
    """start: a view, and the (3, 3) similarity from the first one to it. Returns that from the first one to `view`; None where
    it is unknown."""
    step = follow(start[0], view) if start is not None else None
    return None if start is None or step is None else step @ start[1]


def quarter_points(view: View, place: np.ndarray | None) -> np.ndarray:
    """place: (3, 3) similarity from the first view to this one, or None. Returns (4, 2) px, where four points of the first frame,
    halfway from its middle to its corners, lie now; NaN where unknown."""
    height, width = view.grey.shape
    points = np.array([(x * width, y * height, 1) for x in (0.25, 0.75) for y in (0.25, 0.75)])
    return np.full((4, 2), np.nan) if place is None else (points @ place.T)[:, :2] / view.scale


def follow(before: View, after: View) -> np.ndarray | None:
    """The (3, 3) similarity by which the background moves from one view to the other; None where too little moves as one."""
    start, cell = find_corners(before)
    if len(start) < LEAST_POINTS:
        return None
    end, forth = cv2.calcOpticalFlowPyrLK(before.grey, after.grey, start, np.empty_like(start), **SEARCH)[:2]
    again, back = cv2.calcOpticalFlowPyrLK(after.grey, before.grey, end, np.empty_like(start), **SEARCH)[:2]
    size = np.array(after.grey.shape[::-1])
    column, row = np.clip(np.round(end), 0, size - 1).astype(int).T
    kept = ((forth[:, 0] > 0) & (back[:, 0] > 0) & (np.linalg.norm(again - start, axis=1) < BACK)
            & (end >= 0).all(1) & (end < size).all(1) & after.free[row, column])
    if kept.sum() < LEAST_POINTS:
        return None
    found, agree = cv2.estimateAffinePartial2D(start[kept], end[kept], method=cv2.RANSAC, ransacReprojThreshold=AGREE)
    if found is None:
        return None
    agree = agree[:, 0] > 0
    low, high = np.quantile(start[kept][agree], (0.05, 0.95), axis=0)
    if agree.mean() < LEAST_SHARE or len(np.unique(cell[kept][agree])) < LEAST_CELLS or ((high - low) < LEAST_SPAN * size).any():
        return None
    return np.vstack([found, (0, 0, 1)])


def find_corners(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Returns (n, 2) float32 px x, y of the background's corners, and (n,) the cell of each: the strongest ones of every cell."""
    strength = cv2.cornerMinEigenVal(view.grey, PATCH)
    inside = np.zeros_like(view.free)
    inside[RIM:-RIM, RIM:-RIM] = view.free[RIM:-RIM, RIM:-RIM]
    y, x = np.nonzero(inside & (strength > CORNER) & (strength == cv2.dilate(strength, np.ones((PATCH + 2, PATCH + 2)))))
    cell = y * CELLS // len(strength) * CELLS + x * CELLS // strength.shape[1]
    order = np.lexsort((-strength[y, x], cell))
    x, y, cell = x[order], y[order], cell[order]
    first = np.searchsorted(cell, cell)
    few = np.arange(len(cell)) - first < MOST_IN_CELL
    return np.stack([x, y], 1)[few].astype(np.float32), cell[few]
