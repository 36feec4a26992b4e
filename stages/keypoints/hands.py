"""Detects the two hands of a known body, 21 points each, and decides whose hand a detection is.

Crops come from two networks: one corrects the rough crop at the arm's end, the palm detector searches a wider one. The
detections of both arms are pooled and each is given to at most one arm: a hidden hand must not get the points of the other.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gsac.avatar.region import Region, around_circle, crop, upright_angle
from gsac.avatar.ssd_decode import anchor_centers, decode, suppress
from gsac.avatar.tflite import Network

POINTS = 21
PALM_SCORE = 0.5
SIDE_WEIGHT = 0.3
"""Cost of a detection that the network takes for the other side's hand, in forearm lengths of wrist distance."""


@dataclass(frozen=True)
class Arm:
    wrist: np.ndarray
    """(2,) px, the body's point."""
    pinky: np.ndarray
    """(2,) px, the body's point of the knuckle."""
    index: np.ndarray
    """(2,) px, the body's point of the knuckle."""
    forearm: float
    """px, its length without foreshortening."""


@dataclass(frozen=True)
class Hand:
    points: np.ndarray
    """(21, 2) px: wrist, thumb 1-4, index 1-4, middle 1-4, ring 1-4, pinky 1-4."""
    world: np.ndarray
    """(21, 3) m about the hand's middle, OpenCV axes."""
    presence: float
    """0..1 that this is a hand."""
    right: float
    """0..1, the network's probability that it is a right hand; unreliable when the hand is seen edge-on."""


class HandNetworks:
    """models: name -> file, `hand_recrop`, `palm_detection_full` and `hand_landmark_full`."""

    def __init__(self, models: dict[str, Path], threads: int | None = None):
        self._recrop = Network(models["hand_recrop"], threads)
        self._palm = Network(models["palm_detection_full"], threads)
        self._landmark = Network(models["hand_landmark_full"], threads)
        self._anchors = anchor_centers(self._palm.width, (8, 16, 16, 16))

    def find(self, image: np.ndarray, arms: dict[str, Arm], threshold: float, reach: float) -> dict[str, Hand]:
        """image: (H, W, 3) uint8; arms: by side, `left` and `right`; reach: see `assign`. Returns the hands found, by side."""
        rough = {side: rough_region(arm.wrist, arm.pinky, arm.index) for side, arm in arms.items()}
        regions = [each for region in rough.values() for each in (self.recrop(image, region), *self.palms(image, region))]
        seen = [hand for hand in (self.read(image, each) for each in drop_alike(regions)) if hand.presence >= threshold]
        given = assign(merge(seen), arms, reach)
        for side in rough.keys() - given.keys():
            hand = self.read(image, rough[side].scaled(0.7))
            if hand.presence >= threshold:
                given = assign(merge([*seen, hand]), arms, reach)
        return given

    def recrop(self, image: np.ndarray, rough: Region) -> Region:
        """image: (H, W, 3) uint8. Corrects a rough region."""
        size = self._recrop.width
        out = self._recrop(crop(image, rough, size))[0].reshape(2, 2).astype(np.float64) / size
        return around_circle(*rough.to_frame(out), target=-np.pi / 2).moved(0.0, -0.1)

    def palms(self, image: np.ndarray, rough: Region) -> list[Region]:
        """image: (H, W, 3) uint8. Regions of the hands whose palms are detected in and around a rough region."""
        size, wide = self._palm.width, rough.scaled(1.5)
        raw, logits = self._palm(crop(image, wide, size, outside="black"))
        found = suppress(decode(raw, logits, self._anchors, size, PALM_SCORE))
        regions = []
        for box, points in zip(found.box, found.points, strict=True):
            corners, points = wide.to_frame(box.reshape(2, 2)), wide.to_frame(points)
            side = float(np.hypot(*(corners[1] - corners[0]))) / np.sqrt(2)
            angle = upright_angle(points[0], points[2], np.pi / 2)
            regions.append(Region(tuple(corners.mean(axis=0)), side, angle).moved(0.0, -0.5).scaled(2.6))
        return regions

    def read(self, image: np.ndarray, region: Region) -> Hand:
        """image: (H, W, 3) uint8. The landmark network on one region."""
        size = self._landmark.width
        points, presence, right, world = self._landmark(crop(image, region, size))
        points = points.reshape(POINTS, 3).astype(np.float64) / size
        world = region.turn(world.reshape(POINTS, 3).astype(np.float64))
        return Hand(region.to_frame(points[:, :2]), world, float(presence[0]), float(right[0]))


def rough_region(wrist: np.ndarray, pinky: np.ndarray, index: np.ndarray) -> Region:
    """wrist, pinky, index: (2,) px, body points of one hand. Returns a region about twice the hand's size, fingers up."""
    middle = (2 * index + pinky) / 3
    side = max(2 * float(np.hypot(*(middle - wrist))), 1.0)
    return Region(tuple(middle), side, upright_angle(wrist, middle, np.pi / 2)).scaled(2.7).moved(0.0, -0.1)


def drop_alike(regions: list[Region]) -> list[Region]:
    """Drops each region that is nearly the same square as an earlier one."""
    kept: list[Region] = []
    for region in regions:
        if not any(_alike(region, other) for other in kept):
            kept.append(region)
    return kept


def _alike(a: Region, b: Region) -> bool:
    apart = np.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1])
    turn = abs((a.angle - b.angle + np.pi) % (2 * np.pi) - np.pi)
    return apart < 0.05 * b.side and abs(np.log(a.side / b.side)) < 0.1 and turn < 0.15


def same_hand(a: Hand, b: Hand) -> bool:
    """Whether two detections are of one hand in the image: their points' median distance is less than a quarter of the hand."""
    size = min(np.ptp(a.points, axis=0).max(), np.ptp(b.points, axis=0).max())
    return bool(np.median(np.linalg.norm(a.points - b.points, axis=1)) < size / 4)


def merge(seen: list[Hand]) -> list[Hand]:
    """One detection for each hand in the image: the most certain, its points averaged with those that agree with it."""
    rest = sorted(seen, key=lambda hand: -hand.presence)
    out = []
    while rest:
        group = [hand for hand in rest if same_hand(hand, rest[0])]
        rest = [hand for hand in rest if not same_hand(hand, rest[0])]
        weight = np.array([hand.presence for hand in group]) / sum(hand.presence for hand in group)
        out.append(replace(group[0], points=np.tensordot(weight, [h.points for h in group], axes=1),
                           world=np.tensordot(weight, [h.world for h in group], axes=1),
                           right=float(weight @ [h.right for h in group])))
    return out


def assign(hands: list[Hand], arms: dict[str, Arm], reach: float) -> dict[str, Hand]:
    """Gives each arm one of the hands or none, no hand twice: as many arms as possible, then the least distance of the wrists.

    reach: farthest that a hand's wrist may lie from the arm's, in forearm lengths; a hand that the network takes for the other
    side's counts as `SIDE_WEIGHT` farther.
    """
    def cost(hand: Hand, side: str) -> float:
        arm = arms[side]
        wrong = hand.right if side == "left" else 1 - hand.right
        away = np.hypot(*(hand.points[0] - arm.wrist)) / max(arm.forearm, 1e-6)
        return away + SIDE_WEIGHT * wrong if away <= reach else np.inf

    best, best_cost = {}, (0, 0.0)
    for choice in itertools.product((*hands, None), repeat=len(arms)):
        given = {side: hand for side, hand in zip(arms, choice, strict=True) if hand is not None}
        if len({id(hand) for hand in given.values()}) < len(given):
            continue
        total = (-len(given), sum(cost(hand, side) for side, hand in given.items()))
        if np.isfinite(total[1]) and total < best_cost:
            best, best_cost = given, total
    return best
