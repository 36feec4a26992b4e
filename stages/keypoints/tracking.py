"""Follows one person from frame to frame, and notices a second."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.blazepose import Person, Pose, PoseNetworks
from gsac.avatar.region import Region
from gsac.avatar.threads import available_cores
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame

SECOND_SCORE = 0.7
"""Least score, of detector and landmark network alike, for a second person to be reported."""

STAYS = 0.2
"""How far (`Tracker.away`) the nearest detection lies if it may be somebody else: who turns on the spot moves by 0.1."""
BESIDE = 0.25
"""How far `apart` another person is at least."""


class Tracker:
    """Starts with the largest and most central person, then takes the one nearest to the last place and to the usual one.

    models: name -> file, `pose_detection` and `pose_landmark_full`.
    """

    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        self._least = config.person_threshold
        self._pose = PoseNetworks(models, threads=max(1, min(4, available_cores() // 4)))  # the other cores have other frames
        self._places: list[Region] = []
        """Of the followed person, frame by frame."""

    def track(self, image: np.ndarray, frame: Frame) -> Pose | None:
        """image: (H, W, 3) uint8, the next frame. Returns the followed person's pose, None when not seen; sets
        `frame.others`."""
        persons = self._pose.persons(image, self._least)
        pose = self._follow(image, persons)
        if pose is not None:
            self._places.append(pose.region)
            self._second(image, persons, pose, frame)
        return pose

    def look(self, image: np.ndarray, region: Region) -> Pose | None:
        """image: (H, W, 3) uint8. The pose of a person in that region, None when none is seen there; nobody is followed."""
        pose = self._pose.pose(image, region)
        return pose if pose.score >= self._least else None

    def away(self, region: Region) -> float:
        """How far a region is `apart` from the last place, and from the usual one."""
        return apart(region, self._places[-1]) + apart(region, usual(self._places))

    def _follow(self, image: np.ndarray, persons: list[Person]) -> Pose | None:
        """The followed person's pose; where that person is lost, the nearest other one's."""
        if not self._places:
            order, nearest = sorted(persons, key=lambda p: -prominence(p.region, image.shape[1], image.shape[0])), 0.0
        else:
            order = sorted(persons, key=lambda p: self.away(p.region))
            nearest = self.away(order[0].region) if order else np.inf
        if nearest > STAYS:
            # The detector may miss a person, a back beside another's face, whom the landmark network finds at the last place, or at
            # the usual one after somebody walked past; who moved on is found where the detector has them.
            poses = [self._pose.pose(image, place) for place in (self._places[-1], usual(self._places))]
            found = [pose for pose in poses if pose.score >= self._least]
            best = min(found, key=lambda pose: self.away(pose.region), default=None)
            if best is not None and self.away(best.region) < nearest / 2:
                return best
        for person in order:
            pose = self._pose.pose(image, person.region)
            if pose.score >= self._least:
                return pose
        return None

    def _second(self, image: np.ndarray, persons: list[Person], pose: Pose, frame: Frame) -> None:
        """Notes in the frame where somebody else is seen."""
        for person in persons:
            if apart(person.region, pose.region) < BESIDE:
                continue
            other = self._pose.pose(image, person.region)
            score = min(person.score, other.score)
            middles = [points[[11, 12, 23, 24]].mean(axis=0) for points in (other.points, pose.points)]
            far = np.hypot(*(middles[0] - middles[1])) > 0.15 * min(other.region.side, pose.region.side)
            if far and score >= SECOND_SCORE:
                frame.others.append(other.region)


def prominence(region: Region, width: int, height: int) -> float:
    """Size in the frame, reduced by the distance from its middle."""
    off = np.hypot(region.center[0] / width - 0.5, region.center[1] / height - 0.5)
    return region.side / max(width, height) * (1 - off)


def usual(places: list[Region]) -> Region:
    """The middle one of a person's places, whose angle tells nothing."""
    x, y, side = np.median([(*place.center, place.side) for place in places], 0)
    return Region((float(x), float(y)), float(side), places[-1].angle)


def apart(a: Region, b: Region) -> float:
    """Distance between two persons' regions in units of the larger one, plus half the difference of the logs of their sizes."""
    away = np.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1]) / max(a.side, b.side)
    return float(away + 0.5 * abs(np.log(a.side / b.side)))
