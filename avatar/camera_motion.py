"""How far the camera moves: points of the background, found again frame after frame.

A plain wall has no points, and leaves in the wind, a screen or a person who walks by don't move as one: then it is unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
FAINT, DISTINCT = 0.005, 0.9
"""Least contrast of points that are found by what they look like, and the largest distance of two that are taken for one, over that
of the next best: many are wrong, but only right ones move as one."""
LEAST_POINTS, LEAST_CELLS, LEAST_SPAN = 12, 8, 0.4
"""How many points there must be, in how many cells those must be that move as one, over which share of width and of height."""
LEAST_SHARE, LEAST_FOUND = 0.5, 0.25
"""Share of the points that must move as one: of those followed, and of those found again."""
LEAST_KNOWN = 0.5
"""Share of the frames that must be known."""
MOVED, LEAST_MOVED = 0.003, 2
"""Shares of the longer side from which on the camera has moved, and in how many frames at least: one may be an error."""
STAYS = 0.4
"""Share of the frames in one place from which on it is the camera's own."""


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
    """Returns (T,) px, distance of the frame's background from the place where it mostly is; NaN where that is unknown.

    A frame is compared with the first one, and from where that is out of sight with the last one that is known. After a jump,
    across which no point can be followed, points are looked for everywhere.
    """
    anchor = last = None
    places: list[np.ndarray] = []
    known = 0
    for view in views:
        found = chain(anchor, view)
        if found is None and last is not anchor:
            anchor = last
            found = chain(anchor, view)
        if found is None:
            found = chain(last, view, find_again, LEAST_FOUND)
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
    return np.linalg.norm(places - find_home(np.array(places), MOVED * max(view.grey.shape) / view.scale), axis=2).mean(1)


def find_home(places: np.ndarray, near: float) -> np.ndarray:
    """places: (T, 4, 2) px or NaN; near: px. Returns (4, 2), the place with most others near it where those are many, else the
    median."""
    count = [(np.linalg.norm(places - place, axis=2).mean(1) <= near).sum() for place in places]
    most, known = int(np.argmax(count)), np.isfinite(places[:, 0, 0]).sum()
    return places[most] if count[most] >= STAYS * known else np.nanmedian(places, axis=0)


def find_moved(sway: np.ndarray, longer: int) -> np.ndarray:
    """sway: (T,) px; longer: px of the frame's longer side. Returns (T,) bool, the frames in which the camera stood elsewhere."""
    moved = sway > MOVED * longer
    return moved & (moved.sum() >= LEAST_MOVED)


Pairs = tuple[np.ndarray, np.ndarray]
"""(n, 2) float32 px x, y of points of one view, and where they are in another."""


def follow(before: View, after: View) -> Pairs:
    """Corners of the background that are followed from one view to the other, and back to where they were."""
    start = find_corners(before)
    if len(start) < LEAST_POINTS:
        return start, start
    end, forth = cv2.calcOpticalFlowPyrLK(before.grey, after.grey, start, np.empty_like(start), **SEARCH)[:2]
    again, back = cv2.calcOpticalFlowPyrLK(after.grey, before.grey, end, np.empty_like(start), **SEARCH)[:2]
    kept = (forth[:, 0] > 0) & (back[:, 0] > 0) & (np.linalg.norm(again - start, axis=1) < BACK)
    return start[kept], end[kept]


def find_again(before: View, after: View) -> Pairs:
    """Points of the background that are found by what they look like, each the other's best, wherever and however large."""
    nothing = np.zeros((0, 2), np.float32)
    if min(len(find_corners(view)) for view in (before, after)) < LEAST_POINTS:  # a plain wall: the search takes 40 ms
        return nothing, nothing
    sift, matcher = cv2.SIFT.create(contrastThreshold=FAINT), cv2.BFMatcher()
    (start, first), (end, second) = (sift.detectAndCompute(view.grey, view.free.astype(np.uint8)) for view in (before, after))
    if min(len(start), len(end)) < LEAST_POINTS:
        return nothing, nothing
    back = [match.trainIdx for match in matcher.match(second, first)]
    found = [best for best, other in matcher.knnMatch(first, second, k=2)
             if best.distance < DISTINCT * other.distance and back[best.trainIdx] == best.queryIdx]
    return (np.array([start[match.queryIdx].pt for match in found], np.float32).reshape(-1, 2),
            np.array([end[match.trainIdx].pt for match in found], np.float32).reshape(-1, 2))


def chain(start: tuple[View, np.ndarray] | None, view: View,
          pair: Callable[[View, View], Pairs] = follow, share: float = LEAST_SHARE) -> np.ndarray | None:
    """start: a view, and the (3, 3) similarity from the first one to it; share: of the pairs, that must move as one. Returns the
    similarity from the first one to `view`; None where it is unknown."""
    step = agree(*pair(start[0], view), start[0], view, share) if start is not None else None
    return None if start is None or step is None else step @ start[1]


def quarter_points(view: View, place: np.ndarray | None) -> np.ndarray:
    """place: (3, 3) similarity from the first view to this one, or None. Returns (4, 2) px, where four points of the first frame,
    halfway from its middle to its corners, lie now; NaN where unknown."""
    height, width = view.grey.shape
    points = np.array([(x * width, y * height, 1) for x in (0.25, 0.75) for y in (0.25, 0.75)])
    return np.full((4, 2), np.nan) if place is None else (points @ place.T)[:, :2] / view.scale


def agree(start: np.ndarray, end: np.ndarray, before: View, after: View, share: float) -> np.ndarray | None:
    """start, end: pairs (n, 2) px of points of two views; share: of them, that must move as one. Returns the (3, 3) similarity by
    which the background moves; None where too little does."""
    size = np.array(after.grey.shape[::-1])
    column, row = np.clip(np.round(end), 0, size - 1).astype(int).T
    kept = (end >= 0).all(1) & (end < size).all(1) & after.free[row, column]
    if kept.sum() < LEAST_POINTS:
        return None
    found, as_one = cv2.estimateAffinePartial2D(start[kept], end[kept], method=cv2.RANSAC, ransacReprojThreshold=AGREE)
    if found is None:
        return None
    as_one = as_one[:, 0] > 0
    low, high = np.quantile(start[kept][as_one], (0.05, 0.95), axis=0)
    cells = cell_of(start[kept][as_one], before)
    if as_one.mean() < share or len(np.unique(cells)) < LEAST_CELLS or ((high - low) < LEAST_SPAN * size).any():
        return None
    return np.vstack([found, (0, 0, 1)])


def cell_of(points: np.ndarray, view: View) -> np.ndarray:
    """points: (n, 2) px x, y. Returns (n,) int, the cell that each lies in."""
    column, row = (points * CELLS // np.array(view.grey.shape[::-1])).astype(int).T
    return row * CELLS + column


def find_corners(view: View) -> np.ndarray:
    """Returns (n, 2) float32 px x, y of the background's corners, the strongest ones of every cell."""
    strength = cv2.cornerMinEigenVal(view.grey, PATCH)
    inside = np.zeros_like(view.free)
    inside[RIM:-RIM, RIM:-RIM] = view.free[RIM:-RIM, RIM:-RIM]
    y, x = np.nonzero(inside & (strength > CORNER) & (strength == cv2.dilate(strength, np.ones((PATCH + 2, PATCH + 2)))))
    cell = cell_of(np.stack([x, y], 1), view)
    order = np.lexsort((-strength[y, x], cell))
    x, y, cell = x[order], y[order], cell[order]
    first = np.searchsorted(cell, cell)
    few = np.arange(len(cell)) - first < MOST_IN_CELL
    return np.stack([x, y], 1)[few].astype(np.float32)
