"""A brought FLAME head: shape, expression and jaw from what the face network says."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.flame_file import read_flame, read_flame_points
from gsac.stages.contract import BadInput, Job
from gsac.stages.face import STAGE
from gsac.stages.face.actions import Actions
from gsac.stages.face.config import FaceConfig
from gsac.stages.face.flame import EXPRESSIONS, FlameHead
from gsac.stages.face.head import fit_similarity


@pytest.fixture(scope="module")
def head(flame_file, flame_points_file) -> FlameHead:
    return FlameHead(read_flame(flame_file), read_flame_points(flame_points_file))


@pytest.fixture(scope="module")
def actions() -> Actions:
    return Actions.load()


def as_seen(head: FlameHead, vertices: np.ndarray) -> np.ndarray:
    """(468, 3) what a perfect network says of the head: in its own place and size; far off where it carries no point."""
    points = np.full((468, 3), 9.0)
    turn = rotation.exp(np.array([0.1, 0.02, 0]))
    points[head.points.index] = 0.93 * head.points.on(head.flame, vertices) @ turn.T + [0, 0.1, -0.9]
    return points


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Mean distance, m, of two heads laid on each other: place, turn and size cannot be known."""
    turn, size, shift = fit_similarity(a, b)
    return float(np.linalg.norm(size * a @ turn.T + shift - b, axis=1).mean())


def test_the_head_of_known_points_is_found_whatever_their_place_and_size(head):
    true = head.flame.rest(np.random.default_rng(1).normal(0, 5, 16))
    shape, turn, size = head.model.fit_shape(as_seen(head, true))
    used = np.unique(head.flame.faces[head.points.face])
    off, alone = (apart(vertices[used], true[used]) for vertices in (head.flame.rest(shape), head.flame.v_template))
    assert off < 0.3 * alone
    np.testing.assert_allclose(turn, rotation.exp(np.array([0.1, 0.02, 0])), atol=0.05)


def test_expression_and_jaw_that_move_the_points_are_found_again(head):
    flame = head.flame
    arm = flame.v_template - flame.J_regressor[2] @ flame.v_template
    nod = flame.weights[:, 2, None] * np.cross([0.1, 0, 0], arm)
    response = np.zeros((EXPRESSIONS + 1, 468, 3))
    moves = np.concatenate([flame.exprdirs[:, :, :EXPRESSIONS], nod[:, :, None]], 2)
    response[:, head.points.index] = head.points.on(flame, moves).transpose(2, 0, 1)
    found = head.response(flame.v_template, response, np.eye(3), 1.0)
    told = head.points.on(flame, np.concatenate([flame.exprdirs[:, :, :EXPRESSIONS]], 2))
    again = np.einsum("lck,ak->alc", told, found[:EXPRESSIONS, :EXPRESSIONS])
    wanted = told.transpose(2, 0, 1)
    loud = np.linalg.norm(wanted, axis=-1).max(1) > 0.004
    assert np.abs(again - wanted)[loud].max() < 0.25 * np.abs(wanted[loud]).max()
    assert found[EXPRESSIONS, EXPRESSIONS] == pytest.approx(0.1, abs=0.05)


def test_an_opening_mouth_opens_flames_mouth_and_rest_is_rest(head, actions):
    expression = np.zeros((3, len(actions.names)))
    expression[1, actions.names.index("jawOpen")] = 1
    expression[2, actions.names.index("eyeBlinkLeft")] = 1
    made = head.arrays(actions.neutral, actions, expression)
    assert not made["flame_expression"][0].any() and not made["flame_jaw"][0].any()
    low = made["flame_expression"] @ head.flame.exprdirs[:, 1, :EXPRESSIONS].T
    arm = made["head_vertices"] - head.flame.J_regressor[2] @ made["head_vertices"]
    low = low + np.cross(made["flame_jaw"][:, None], arm)[..., 1] * head.flame.weights[:, 2]
    assert low[1].min() < -0.015 and low[2].min() > -0.008
    assert made["head_eyes"][0, 0] > 0 > made["head_eyes"][1, 0]


def test_only_who_asks_for_flame_needs_its_files():
    assert STAGE.models(FaceConfig()) == ("face_landmark", "face_landmark_with_attention")
    assert STAGE.models(FaceConfig(flame="mine"))[2:] == ("mine", "flame-points")
    assert FlameHead.of(Job({}, None, FaceConfig())) is None


def test_a_wrong_file_is_named_by_its_parameter(flame_file, flame_points_file, tmp_path):
    models = {"mine": flame_file, "flame-points": flame_points_file}
    assert FlameHead.of(Job({}, None, FaceConfig(flame="mine"), models=models)).flame.faces.shape == (9976, 3)
    with pytest.raises(BadInput, match="face.flame is mine: .* array v_template is missing"):
        FlameHead.of(Job({}, None, FaceConfig(flame="mine"), models=models | {"mine": flame_points_file}))
    pickled = tmp_path / "flame-points"
    pickled.write_bytes(b"\x80\x04}.")
    with pytest.raises(BadInput, match="face.flame_points is flame-points: .*run code"):
        FlameHead.of(Job({}, None, FaceConfig(flame="mine"), models=models | {"flame-points": pickled}))
