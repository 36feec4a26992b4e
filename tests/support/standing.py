"""Somebody who stands in the frame, as the networks of stage keypoints see them, without these networks."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.blazepose import Person, Pose
from gsac.avatar.region import Region
from gsac.avatar.wholebody import HANDS, INDEX
from gsac.benchmarks.perception import write_split
from gsac.stages.contract import Job
from gsac.stages.keypoints import detector, tracking
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detector import POSE33
from gsac.stages.keypoints.stage import run

WIDTH, HEIGHT = 300, 380
"""px; the crop around the person leaves the frame on the right and below."""


def stand() -> np.ndarray:
    """Points (133, 2) px of somebody who stands in the frame, arms away from the body, tilted a little."""
    at = np.tile([180.0, 100.0], (133, 1))
    places = {"nose": (0, 0), "eye": (4, -5), "ear": (9, -2), "shoulder": (28, 40), "elbow": (55, 75), "wrist": (75, 110),
              "hip": (18, 120), "knee": (20, 180), "ankle": (20, 240), "heel": (20, 248), "big_toe": (26, 252),
              "small_toe": (30, 252)}
    for name, index in INDEX.items():
        side, _, part = name.partition("_")
        across, down = places.get(part if side in ("left", "right") else name, (0, 5))
        at[index] += (across * (1 if side == "left" else -1), down)
    for sign, hand in zip((1, -1), HANDS.values(), strict=True):
        finger = np.maximum(np.arange(21) - 1, 0)
        at[hand] = [180 + sign * 75, 210]
        at[hand] += np.stack([sign * (finger // 4 - 2) * 2.0, 3.0 * (finger % 4 + 1) * (np.arange(21) > 0)], axis=1)
    turn = np.deg2rad(8)
    return (at - [180, 240]) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + [180, 240]


class Blaze:
    """Sees the person of `stand` in each frame, without any network."""

    def __init__(self, *_, **__):
        pass

    def persons(self, image, threshold, within=None):
        return [Person(Region((180, 240), 400), 0.9)]

    def pose(self, image, region):
        points = np.tile(stand().mean(axis=0), (33, 1))
        points[list(POSE33.values())] = stand()[[INDEX[name] for name in POSE33]]
        world = np.column_stack([(points - points[[23, 24]].mean(axis=0)) / 160, np.zeros(33)])
        return Pose(points, np.ones(33), np.ones(33), world, 0.9, Region((180, 240), 400))


class NoFace:
    def __init__(self, *_, **__):
        pass

    def find(self, *_):
        return None


@pytest.fixture
def blaze(monkeypatch):
    """Puts `Blaze` in the place of the networks that find person and face."""
    monkeypatch.setattr(tracking, "PoseNetworks", Blaze)
    monkeypatch.setattr(detector, "FaceMesh", NoFace)


def run_keypoints(frames: list[np.ndarray], folder: Path, config: KeypointsConfig, models: dict[str, Path]) -> dict[str, Path]:
    """Runs stage keypoints; returns its ports and those of the frames."""
    ports = write_split(iter(frames), folder / "split")
    (folder / "keypoints").mkdir()
    run(Job(ports, folder / "keypoints", config, models))
    return ports | {"keypoints/keypoints.npz": folder / "keypoints" / "keypoints.npz"}
