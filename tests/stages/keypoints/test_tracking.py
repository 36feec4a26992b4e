"""One person is followed, also where the detector sees only somebody else; and who stands beside them is noticed."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar.blazepose import Person, Pose
from gsac.avatar.region import Region
from gsac.stages.keypoints import tracking
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.tracking import Tracker

IMAGE = np.zeros((480, 270, 3), np.uint8)
SIDE = 470.0


class FakeNetworks:
    """A scene of persons, each a region; the detector sees some of them, the landmark network whoever is in its region."""

    def __init__(self, models, threads):
        self.there: list[Region] = []
        self.detected: list[int] = []

    def persons(self, image, threshold, within=None):
        return [Person(self.there[k], 0.9) for k in self.detected]

    def pose(self, image, region):
        def away(one):
            return np.hypot(one.center[0] - region.center[0], one.center[1] - region.center[1])

        found = min(self.there, key=away)
        score = 1.0 if away(found) < 0.3 * region.side else 0.0
        points = np.tile(np.array(found.center), (33, 1))
        return Pose(points, np.ones(33), np.ones(33), np.zeros((33, 3)), score, found)


@pytest.fixture
def tracker(monkeypatch):
    monkeypatch.setattr(tracking, "PoseNetworks", FakeNetworks)
    return Tracker({}, KeypointsConfig())


def at(x: float, side: float = SIDE) -> Region:
    return Region((x, 235.0), side)


def track(tracker: Tracker, there: list[Region], detected: list[int]) -> tuple[float | None, bool]:
    """Where the followed person is in the next frame, and whether a second one was seen."""
    tracker._pose.there, tracker._pose.detected = there, detected
    frame = Frame()
    pose = tracker.track(IMAGE, frame)
    return None if pose is None else pose.region.center[0], bool(frame.others)


def test_a_back_that_is_not_detected_is_followed_though_another_face_is_near(tracker):
    assert track(tracker, [at(140)], [0]) == (140, False)
    for x in (145, 150, 148):
        assert track(tracker, [at(x), at(x + 75, 340)], [1]) == (x, True)
    assert track(tracker, [at(146), at(221, 340)], [1, 0]) == (146, True)


def test_who_moves_by_a_third_of_themselves_is_found_where_they_are_detected(tracker):
    track(tracker, [at(100)], [0])
    assert track(tracker, [at(230)], [0]) == (230, False)


def test_who_left_gives_way_to_the_nearest_person(tracker):
    track(tracker, [at(60, 200)], [0])
    assert track(tracker, [at(200, 200)], [0]) == (200, False)


def test_one_person_detected_twice_is_no_second_person(tracker):
    track(tracker, [at(140)], [0])
    tracker._pose.persons = lambda *words: [Person(at(140), 0.9), Person(at(250, 400), 0.9)]
    assert track(tracker, [at(140)], [0]) == (140, False)
