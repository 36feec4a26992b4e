"""DECA's encoder, as a made-up network of its shapes: where it looks, what it is shown and where its numbers go."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.facemesh import IBUG68
from gsac.avatar.flame_file import read_flame, read_flame_points
from gsac.avatar.frame_files import write_frame
from gsac.stages.contract import BadInput, make_config
from gsac.stages.face import STAGE
from gsac.stages.face.deca import CODES, DecaEncoder
from gsac.stages.face.flame import FlameHead
from gsac.stages.face.stage import encode_head
from support.onnx_files import write_encoder

HEIGHT, WIDTH = 400, 300


def ramps() -> np.ndarray:
    """(H, W, 3) uint8: red tells x, green y, blue is even."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    return np.stack([x * 0.8, y * 0.6, np.full_like(x, 200)], -1).round().astype(np.uint8)


def face_at(centre: tuple[float, float], width: float, height: float) -> np.ndarray:
    """(468, 3) px whose 68 points fill a box."""
    points = np.full((468, 3), 1e4)
    half = np.array([width, height]) / 2
    points[IBUG68, :2] = centre + np.random.default_rng(0).uniform(-1, 1, (68, 2)) * half
    points[IBUG68[:2], :2] = centre - half, centre + half
    return points


@pytest.fixture(scope="module")
def encoder_file(tmp_path_factory) -> Path:
    """Its first twelve texture numbers are the quadrants' colours; shape, expression and jaw mix them."""
    rng = np.random.default_rng(3)
    mixing, constant = rng.normal(0, 1, (12, CODES)), rng.normal(0, 0.1, CODES)
    mixing[:, 100:112], constant[100:112] = np.eye(12), 0
    mixing[:, 203:206], constant[203:206] = 0, [0.2, 0.01, 0]
    return write_encoder(tmp_path_factory.mktemp("deca") / "e_flame.onnx", mixing, constant)


@pytest.mark.parametrize("centre, width, height", [((150.0, 180.0), 90.0, 110.0), ((120.5, 250.25), 61.0, 80.0)])
def test_the_encoder_sees_red_green_and_blue_of_the_square_about_the_face(encoder_file, centre, width, height):
    codes = DecaEncoder(encoder_file).read(ramps(), face_at(centre, width, height))
    red, green, blue = codes[100:112].reshape(3, 2, 2) * 255
    left, right = red.mean(0) / 0.8
    top, bottom = green.mean(1) / 0.6
    side = (width + height) / 2 * 1.1 * 1.25
    assert abs((left + right) / 2 - centre[0]) < 0.5 and abs((top + bottom) / 2 - centre[1]) < 0.5, "px"
    assert abs((right - left) * 2 - side) < 1 and abs((bottom - top) * 2 - side) < 1, "px of the whole side"
    np.testing.assert_allclose(blue, 200, atol=0.05)


def test_shape_expression_and_jaw_go_where_flame_has_them(encoder_file, flame_file, flame_points_file, tmp_path):
    head = FlameHead(read_flame(flame_file), read_flame_points(flame_points_file))
    encoder, paths, landmarks = DecaEncoder(encoder_file), [], np.full((3, 468, 3), np.nan)
    for t, centre in enumerate([(150.0, 180.0), (0.0, 0.0), (140.0, 170.0)]):
        paths.append(tmp_path / f"{t:06d}.png")
        write_frame(paths[-1], ramps())
        if t != 1:  # no face is seen there
            landmarks[t] = face_at(centre, 90, 110)
    found = encode_head(head, encoder, paths, landmarks, np.array([0, 0.1, 0.2]), rest_time=0.2)
    codes = [encoder.read(ramps(), landmarks[t]) for t in (0, 2)]
    np.testing.assert_allclose(found["flame_expression"][[0, 2]], [c[150:200] for c in codes], atol=1e-4)
    np.testing.assert_allclose(found["flame_jaw"][[0, 2]], [[0.2, 0.01, 0]] * 2, atol=1e-4)
    np.testing.assert_allclose(found["flame_expression"][1], codes[0][150:200] * np.exp(-0.5), atol=1e-4)
    rest = head.flame.rest(np.mean([c[:100] for c in codes], 0))
    np.testing.assert_allclose(found["head_vertices"], rest, atol=1e-4)


def test_another_network_is_refused_with_its_shapes(tmp_path):
    other = write_encoder(tmp_path / "small.onnx", np.zeros((12, CODES)), np.zeros(CODES), size=112)
    with pytest.raises(BadInput, match=r"deca-encoder takes \['N', 3, 112, 112\].*expected DECA's E_flame"):
        DecaEncoder(other)
    few = write_encoder(tmp_path / "few.onnx", np.zeros((12, 100)), np.zeros(100))
    with pytest.raises(BadInput, match=r"deca-encoder takes .* and gives \['N', 100\]; expected"):
        DecaEncoder(few)
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(BadInput, match="deca-encoder .*ONNX"):
        DecaEncoder(tmp_path / "text.onnx")


def test_who_asks_for_deca_needs_the_encoder_and_a_flame_head():
    with pytest.raises(BadInput, match="face.method is deca, but face.flame is none"):
        make_config(STAGE, {"method": "deca"})
    assert STAGE.models(make_config(STAGE, {"method": "deca", "flame": "mine"}))[2:] == ("mine", "flame-points", "deca-encoder")
