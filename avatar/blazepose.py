"""BlazePose: persons in a frame, and the 33 points of one of them.

Detector 224 px on the whole frame, landmark network 256 px on a circle about the hips (Bazarevsky et al. 2020).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.avatar.logistic import clipped_sigmoid
from gsac.avatar.region import Region, around_circle, crop, full_frame
from gsac.avatar.ssd_decode import anchor_centers, decode, suppress
from gsac.avatar.tflite import Network

POINTS = 33
HIPS, RIM = 33, 34
"""Auxiliary outputs: the middle of the hips, and a point above the head on the circle around the body."""


@dataclass(frozen=True)
class Person:
    region: Region
    score: float
    """0..1."""


@dataclass(frozen=True)
class Pose:
    points: np.ndarray
    """(33, 2) px."""
    visibility: np.ndarray
    """(33,) 0..1: in the frame and not covered."""
    presence: np.ndarray
    """(33,) 0..1: in the frame."""
    world: np.ndarray
    """(33, 3) m, hips at 0, OpenCV axes."""
    score: float
    """0..1 that there is a person."""
    region: Region
    """Where to look for the same person next."""


class PoseNetworks:
    """models: name -> file, `pose_detection` and `pose_landmark_full`."""

    def __init__(self, models: dict[str, Path], threads: int | None = None):
        self._detector = Network(models["pose_detection"], threads)
        self._landmark = Network(models["pose_landmark_full"], threads)
        self._anchors = anchor_centers(self._detector.width, (8, 16, 32, 32, 32))

    def persons(self, image: np.ndarray, threshold: float, within: Region | None = None) -> list[Person]:
        """image: (H, W, 3) uint8. Persons of at least this score, best first, whose hips lie at most the image's longer side
        beside it: empty rooms are taken for giants far outside. within: looked for there, else in the whole frame."""
        size = self._detector.width
        frame = within or full_frame(image.shape[1], image.shape[0])
        raw, logits = self._detector(crop(image, frame, size, outside="black") * 2 - 1)
        found = suppress(decode(raw, logits, self._anchors, size, threshold))
        circles = frame.to_frame(found.points[:, :2])
        persons = [Person(around_circle(*circle).scaled(1.25), float(score))
                   for circle, score in zip(circles, found.score, strict=True)]
        return [person for person in persons if _beside(person.region.center, image) <= max(image.shape[:2])]

    def pose(self, image: np.ndarray, region: Region) -> Pose:
        """image: (H, W, 3) uint8. The landmark network on one region."""
        size = self._landmark.width
        raw, score, _mask, heat, world = self._landmark(crop(image, region, size))
        raw = raw.reshape(-1, 5).astype(np.float64)
        points = region.to_frame(refine(raw[:, :2] / size, heat))
        world = region.turn(world.reshape(-1, 3)[:POINTS].astype(np.float64))
        return Pose(points[:POINTS], clipped_sigmoid(raw[:POINTS, 3]), clipped_sigmoid(raw[:POINTS, 4]), world, float(score[0]),
                    around_circle(points[HIPS], points[RIM]).scaled(1.25))


def _beside(point: tuple[float, float], image: np.ndarray) -> float:
    """How far a point (x, y) lies outside the image (H, W, 3), px, along the axis along which it is farther."""
    height, width = image.shape[:2]
    x, y = point
    return max(-x, x - width, -y, y - height, 0.0)


def refine(points: np.ndarray, heat: np.ndarray, reach: int = 3, least: float = 0.5) -> np.ndarray:
    """points: (n, 2) in 0..1; heat: (h, w, n) logits. Returns (n, 2): the heat's centre of mass within `reach` cells of each point,
    or the point itself where the heat's peak there is below `least`."""
    height, width, n = heat.shape
    out = points.copy()
    for i in range(n):
        col, row = int(points[i, 0] * width), int(points[i, 1] * height)
        if not (0 <= points[i, 0] < 1 and 0 <= points[i, 1] < 1):
            continue
        rows = np.arange(max(0, row - reach), min(height, row + reach + 1))
        cols = np.arange(max(0, col - reach), min(width, col + reach + 1))
        weight = clipped_sigmoid(heat[rows[0]:rows[-1] + 1, cols[0]:cols[-1] + 1, i].astype(np.float64))
        if weight.max() >= least:
            # The networks count a cell by its low corner, not its middle.
            out[i] = (weight.sum(axis=0) @ cols / width, weight.sum(axis=1) @ rows / height) / weight.sum()
    return out
