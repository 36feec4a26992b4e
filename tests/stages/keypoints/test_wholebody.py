"""A brought whole-body network, from the frame's pixels to keypoints.npz and handgap; the networks' answers are known."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import check_filled_keypoints, read_arrays
from gsac.avatar.simcc import SimccNetwork, crop_matrix
from gsac.avatar.wholebody import HANDS
from gsac.stages.contract import BadInput, Job
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.stage import run as fill
from gsac.stages.keypoints.config import KeypointsConfig
from support.onnx_files import write_brightest, write_figure
from support.standing import HEIGHT, WIDTH, Blaze, blaze, run_keypoints, stand  # noqa: F401, blaze is a fixture

pytestmark = pytest.mark.usefixtures("blaze")
LEFT = HANDS["left"]


def detect(frames: list[np.ndarray], network: Path, folder: Path) -> dict[str, Path]:
    return run_keypoints(frames, folder, KeypointsConfig("onnx-wholebody"), {"onnx-wholebody": network})


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
