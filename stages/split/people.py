"""Finds where the people of a clip are, by BlazePose's two networks, in pictures as small as frames would be without a crop."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import frame_paths
from gsac.avatar.blazepose import Pose, PoseNetworks
from gsac.avatar.frame_files import read_frame
from gsac.avatar.region import Region
from gsac.stages.split.crop import Extent, plan_crop

SHOULDERS, HIPS = [11, 12], [23, 24]
"""Of the landmark network's points."""
LEAST_SCORE = 0.5
"""Of detector and landmark network alike, for a person to count as seen."""
LEAST_SEEN = 0.75
"""Share of the pictures that must show a person; else it is not known where the person is."""


class People:
    """Looks at one picture after another."""

    def __init__(self, models: dict[str, Path]):
        """models: name -> file, of `config.NETWORKS`."""
        self._models = models
        self._last: Region | None = None
        self.looked = self.seen = 0

    @cached_property
    def _networks(self) -> PoseNetworks:
        """Loaded for the first picture: most footage needs none."""
        return PoseNetworks(self._models, threads=1)

    def start_anew(self) -> None:
        """Forgets what was seen: other pictures follow."""
        self._last, self.looked, self.seen = None, 0, 0

    @property
    def known(self) -> bool:
        """Whether enough of the pictures showed a person."""
        return self.seen > 0 and self.seen >= LEAST_SEEN * self.looked

    def look(self, image: np.ndarray) -> Extent | None:
        """The extent of all people in image (H, W, 3) uint8, px; None where nobody is seen."""
        found = None
        self.looked += 1
        for pose in self._poses(image):
            found = Extent.of(pose.points).joined(found)
        self.seen += found is not None
        return found

    def lean(self, image: np.ndarray) -> float | None:
        """How far the trunk of the person in image (H, W, 3) uint8 leans from upright, rad, rising clockwise as seen, -pi..pi; None
        where nobody is seen."""
        for pose in self._poses(image):
            x, y = pose.points[SHOULDERS].mean(0) - pose.points[HIPS].mean(0)
            return float(np.arctan2(x, -y))
        return None

    def follow(self, image: np.ndarray) -> Extent | None:
        """As `look`, of one person, who is looked for at the last place first, in half the time. image: (H, W, 3) uint8."""
        pose = self._networks.pose(image, self._last) if self._last is not None else None
        if pose is None or pose.score < LEAST_SCORE:
            return self.look(image)
        self._last = pose.region
        self.looked, self.seen = self.looked + 1, self.seen + 1
        return Extent.of(pose.points)

    def _poses(self, image: np.ndarray) -> Iterator[Pose]:
        persons = []
        for part in (None, *squares(image.shape[1], image.shape[0])):
            persons = self._networks.persons(image, LEAST_SCORE, part)
            if persons:
                break
        regions = [person.region for person in persons]
        if not regions and self._last is not None:
            regions = [self._last]
        for region in regions:
            pose = self._networks.pose(image, region)
            if pose.score >= LEAST_SCORE:
                self._last = pose.region
                yield pose


def find_extent(people: People, pictures: Iterable[np.ndarray], width: int, height: int, max_height: int) -> Extent | None:
    """Where people are in footage of width x height px, by pictures (H, W, 3) uint8 of it; None where that is not known, or where
    the first few already show that a crop would gain too little."""
    extent = None
    for picture in pictures:
        seen = people.look(picture)
        if seen is None:
            continue
        extent = seen.mapped(height / picture.shape[0]).joined(extent)
        if plan_crop(extent, width, height, max_height) is None:
            return None
    return extent if people.known else None


def find_shown(people: People, frames: Path, asked: np.ndarray) -> np.ndarray:
    """(T,) bool: those of the asked frames that show somebody. frames: their folder; asked: (T,) bool."""
    shown, paths = np.zeros(len(asked), bool), frame_paths(frames)
    for t in np.flatnonzero(asked):
        people.start_anew()
        shown[t] = people.look(read_frame(paths[t])) is not None
    return shown


def squares(width: int, height: int) -> list[Region]:
    """Three squares that cover a picture of width x height px along its longer side: in them a small person is larger."""
    side, longer = sorted((width, height))
    places = [side / 2, longer / 2, longer - side / 2]
    return [Region((side / 2, place) if height > width else (place, side / 2), float(side)) for place in places]
