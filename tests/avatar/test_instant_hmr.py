"""InstantHMR with a made-up network of the official shapes, whose answer is known: crop, colours, condition, and the way back."""

import numpy as np
import pytest

from gsac.avatar.instant_hmr import InstantHmr, to_wholebody
from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.wholebody import INDEX
from support.onnx_files import write_encoder, write_instant_hmr

HEIGHT, WIDTH = 320, 240
SPOTS = np.array([[60.0, 100.0], [150.0, 200.0], [110.0, 60.0]])
"""Middles of a red, a green and a blue square, px."""
BOX = np.array([40.0, 30.0, 170.0, 230.0])


def picture():
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for colour, (x, y) in enumerate(SPOTS.astype(int)):
        image[y - 6:y + 6, x - 6:x + 6, colour] = 200 + 20 * colour
    return image


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    flat, points = np.zeros((13, 70, 2)), np.zeros((13, 70, 3))
    for colour in range(3):
        flat[6 + colour, colour, 0] = flat[9 + colour, colour, 1] = 1
        points[colour, 10, colour] = points[3 + colour, 11, colour] = 1
    points[12, 12] = [1, 2, 3]
    path = write_instant_hmr(tmp_path_factory.mktemp("hmr") / "net.onnx", flat, points)
    return InstantHmr(path, "my-hmr")


def test_the_answer_is_that_of_the_frames_own_pixels_and_metres(network):
    for box in (BOX, BOX + [-60, -20, -60, -20], BOX * 0.9 + 3.3):
        xy, points = network.read(picture(), box)
        inside = [abs(spot - (box[:2] + box[2:]) / 2).max() < (box[2:] - box[:2]).max() * 0.6 - 8 for spot in SPOTS]
        assert sum(inside) >= 2
        np.testing.assert_allclose(xy[:3][inside], SPOTS[inside], atol=0.1)
        np.testing.assert_allclose(points[12], [1, 2, 3], atol=1e-4)


def test_colours_come_as_rgb_by_imagenets_mean_and_the_condition_says_where_the_box_lies(network):
    _, points = network.read(picture(), BOX)
    np.testing.assert_allclose(points[10], np.array([200, 220, 240]) / 255, atol=2e-2)
    np.testing.assert_allclose(points[11], [2 * 105 / WIDTH - 1, 2 * 130 / HEIGHT - 1, 200 / HEIGHT], atol=1e-4)
    flat = np.full((HEIGHT, WIDTH, 3), (10, 130, 250), np.uint8)
    np.testing.assert_allclose(network.read(flat, BOX)[1][10], np.array([10, 130, 250]) / 255, atol=1e-4)


def test_the_points_have_the_names_that_the_rig_gives_them():
    found = to_wholebody(np.arange(70.0)[:, None])[:, 0]
    names = {"nose": 0, "right_elbow": 8, "left_hip": 9, "right_ankle": 14, "left_big_toe": 15, "right_heel": 20, "left_wrist": 62,
             "right_wrist": 41, "right_hand_wrist": 41, "right_hand_thumb1": 24, "right_hand_thumb4": 21, "right_hand_index1": 28,
             "left_hand_wrist": 62, "left_hand_thumb4": 42, "left_hand_pinky1": 61, "left_hand_pinky4": 58}
    assert {name: found[INDEX[name]] for name in names} == names
    assert np.isnan(found[23:91]).all() and np.isfinite(found[:23]).all()


def test_another_network_or_points_that_are_none_are_named_with_what_is_needed(tmp_path):
    other = write_encoder(tmp_path / "other.onnx", np.zeros((12, 5)), np.zeros(5))
    with pytest.raises(NetworkError, match=r"model file mine has .*expected InstantHMR's .*cliff_cond.*joints_3d"):
        InstantHmr(other, "mine")
    broken = write_instant_hmr(tmp_path / "nan.onnx", np.full((13, 70, 2), np.nan), np.zeros((13, 70, 3)))
    with pytest.raises(NetworkError, match="numbers that are none"):
        InstantHmr(broken, "mine").read(picture(), BOX)
