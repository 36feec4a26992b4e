from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.wholebody import HANDS
from gsac.stages.contract import BadInput
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.simcc import SimccNetwork, crop_matrix, decode, drop_doubled_hand

BRIGHTEST = Path(__file__).resolve().parents[2] / "fixtures" / "keypoints" / "brightest.onnx"
"""A SimCC network of the usual shapes, 288 x 384, that puts all its points on the brightest pixel."""


def test_a_bright_spot_is_found_where_it_lies_in_the_frame():
    network = SimccNetwork(BRIGHTEST)
    yy, xx = np.mgrid[:800, :600] + 0.5
    for spot in ((210.0, 333.0), (401.5, 590.5), (300.0, 150.0)):
        bright = 250 * np.exp(-((xx - spot[0]) ** 2 + (yy - spot[1]) ** 2) / 200)
        image = np.repeat(bright[..., None], 3, axis=-1).astype(np.uint8)
        matrix = crop_matrix(np.array([[150.0, 100], [450.0, 700]]), network.width, network.height)
        xy, score = network.read(image, matrix)
        assert np.abs(xy - spot).max() < matrix[0, 0]
        assert xy.shape == (133, 2) and (score > 0.9).all() and (score <= 1).all()


def test_the_crop_holds_the_padded_points_at_its_own_aspect():
    points = np.array([[100.0, 50], [200.0, 650]])
    matrix = crop_matrix(points, 288, 384)
    low, high = matrix[:, 2], matrix[:, :2] @ [288, 384] + matrix[:, 2]
    np.testing.assert_allclose((low + high) / 2, [150, 350])
    np.testing.assert_allclose(high - low, [750 * 288 / 384, 750])


def test_decode_reads_half_pixels_and_the_lesser_peak():
    x, y = np.zeros((1, 20)), np.zeros((1, 40))
    x[0, 7], y[0, 12] = 0.9, 0.6
    at, score = decode(x, y, 10, 20)
    np.testing.assert_allclose(at, [[4.0, 6.5]])
    assert score == [0.6]


def test_both_hands_on_one_place_leave_the_surer_one():
    frame = Frame()
    frame.xy[HANDS["left"]] = np.random.default_rng(0).uniform(0, 50, (21, 2))
    frame.xy[HANDS["right"]] = frame.xy[HANDS["left"]] + 3
    frame.score[HANDS["left"]], frame.score[HANDS["right"]] = 0.5, 0.8
    drop_doubled_hand(frame)
    assert not frame.score[HANDS["left"]].any() and frame.score[HANDS["right"]].all()
    frame.score[HANDS["left"]] = 0.5
    frame.xy[HANDS["right"]] += 60
    drop_doubled_hand(frame)
    assert frame.score[HANDS["left"]].all() and frame.score[HANDS["right"]].all()


def test_the_config_asks_for_the_file_that_the_user_brings():
    assert "onnx-wholebody" in KeypointsConfig(detector="onnx-wholebody").models()
    assert "onnx-wholebody" not in KeypointsConfig().models()


def test_a_file_that_is_no_network_is_refused(tmp_path):
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a network")
    with pytest.raises(BadInput, match="onnx-wholebody cannot be read as ONNX"):
        SimccNetwork(broken)
