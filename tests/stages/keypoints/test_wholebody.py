"""A brought whole-body network, from the frame's pixels to keypoints.npz and handgap; the networks' answers are known."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import check_filled_keypoints, read_arrays
from gsac.avatar.blazepose import Person, Pose
from gsac.avatar.region import Region
from gsac.avatar.wholebody import HANDS, INDEX
from gsac.benchmarks.perception import write_split
from gsac.stages.contract import BadInput, Job
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.stage import run as fill
from gsac.stages.keypoints import detector, tracking
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detector import POSE33
from gsac.stages.keypoints.simcc import SimccNetwork, crop_matrix
from gsac.stages.keypoints.stage import run
from support.onnx_files import write_brightest, write_figure

WIDTH, HEIGHT = 300, 380
"""px; the crop around the person leaves the frame on the right and below."""
LEFT, RIGHT = HANDS.values()


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
    for sign, hand in ((1, LEFT), (-1, RIGHT)):
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


@pytest.fixture(autouse=True)
def blaze(monkeypatch):
    monkeypatch.setattr(tracking, "PoseNetworks", Blaze)
    monkeypatch.setattr(detector, "FaceMesh", NoFace)


def detect(frames: list[np.ndarray], network: Path, folder: Path, **parameters) -> dict[str, Path]:
    """Runs stage keypoints; returns its ports and those of the frames."""
    ports = write_split(iter(frames), folder / "split")
    (folder / "keypoints").mkdir()
    config = KeypointsConfig(detector="onnx-wholebody", **parameters)
    run(Job(ports, folder / "keypoints", config, models={"onnx-wholebody": network}))
    return ports | {"keypoints/keypoints.npz": folder / "keypoints" / "keypoints.npz"}


def box_matrix() -> np.ndarray:
    """(2, 3) crop pixels to the frame's, of the person whom `Blaze` sees."""
    points = Blaze().pose(None, None).points
    return crop_matrix(points, 288, 384)


def test_each_colour_is_found_where_it_lies_in_the_frame(tmp_path):
    """The order of colours, the crop, its rim and the way back: each of them wrong moves a place."""
    step = box_matrix()[0, 0]
    assert 0.7 < step < 1, "a pixel of the crop is less than the frame's"
    spots = np.array([[120.5, 200.5], [250.5, 90.5], [185.5, 330.5]])
    yy, xx = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    image = np.stack([peak * np.exp(-((xx - x) ** 2 + (yy - y) ** 2) / 18)
                      for (x, y), peak in zip(spots, (240, 200, 160), strict=True)], -1)
    ports = detect([np.rint(image).astype(np.uint8)] * 2, write_brightest(tmp_path / "net.onnx", 1.0), tmp_path)
    found = read_arrays(ports["keypoints/keypoints.npz"])
    colour = np.arange(133) % 3
    assert np.abs(found["xy"] - spots[colour]).max() <= 0.5
    assert found["score"].max() <= 1 and str(found["detector"]) == "onnx-wholebody"
    assert np.isfinite(found["world"][:, :17]).all()


def test_the_network_reads_colours_by_the_official_mean_and_deviation(tmp_path):
    network = SimccNetwork(write_brightest(tmp_path / "net.onnx", 1.0))
    image = np.tile(np.array([240, 200, 160], np.uint8), (HEIGHT, WIDTH, 1))
    _, peaks = network.read(image, box_matrix())
    np.testing.assert_allclose(peaks, np.array([240, 200, 160])[np.arange(133) % 3] / 255, atol=1e-4)


@pytest.mark.parametrize(("seen", "hidden"), [(3.0, 0.3), (6.0, 0.2), (0.8, 0.1)])
def test_a_hidden_hand_is_found_whatever_the_scale_of_the_networks_peaks(tmp_path, seen, hidden):
    """RTMW's peaks exceed 1, DWPose's do not; handgap reads the same of both."""
    matrix = box_matrix()
    at = (stand() - matrix[:, 2]) / matrix[0, 0]
    high, low = np.full(133, seen), np.full(133, seen)
    low[LEFT] = hidden
    lit, dark = np.full((HEIGHT, WIDTH, 3), 120, np.uint8), np.full((HEIGHT, WIDTH, 3), (120, 120, 0), np.uint8)
    frames = [lit] * 5 + [dark] * 4 + [lit] * 5
    ports = detect(frames, write_figure(tmp_path / "net.onnx", at, high, low), tmp_path)
    found = read_arrays(ports["keypoints/keypoints.npz"])
    assert np.abs(found["xy"] - stand()).max() <= 0.5
    assert found["score"][:, :91].min() >= 0.79 and found["score"].max() <= 1
    (tmp_path / "handgap").mkdir()
    fill(Job(ports, tmp_path / "handgap", HandgapConfig()))
    missing = check_filled_keypoints(tmp_path / "handgap" / "keypoints.npz")["missing"]
    assert missing[:, 0].tolist() == [False] * 5 + [True] * 4 + [False] * 5 and not missing[:, 1].any()


def test_a_network_whose_scores_cannot_be_told_is_refused(tmp_path):
    network = write_figure(tmp_path / "net.onnx", np.full((133, 2), 100.0), np.full(133, 60.0), np.zeros(133))
    with pytest.raises(BadInput, match="onnx-wholebody gives peaks whose strongest tenth begins at 60; expected 0.25 to 1.5"):
        detect([np.full((HEIGHT, WIDTH, 3), 120, np.uint8)] * 2, network, tmp_path)
