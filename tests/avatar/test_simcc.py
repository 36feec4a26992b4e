from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.simcc import SimccNetwork, crop_matrix, decode

BRIGHTEST = Path(__file__).resolve().parents[1] / "fixtures" / "keypoints" / "brightest.onnx"
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


def test_a_file_that_is_no_network_is_refused(tmp_path):
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a network")
    with pytest.raises(NetworkError, match="onnx-wholebody cannot be read as ONNX"):
        SimccNetwork(broken)
