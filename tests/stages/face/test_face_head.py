"""The open body's head takes the shape of the person's resting points."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.stages.face.actions import Actions
from gsac.stages.face.head import HeadModel, fit_similarity
from gsac.stages.smplx.paper.head import Head


@pytest.fixture(scope="module")
def actions() -> Actions:
    return Actions.load()


@pytest.fixture(scope="module")
def head(actions) -> HeadModel:
    return HeadModel.of_open_body(actions)


def as_seen(head: HeadModel, shape: np.ndarray) -> np.ndarray:
    """(468, 3) what the network says of a head of this shape: beside the skin as always, in its own place, turn and size."""
    turn, size, shift = fit_similarity(head.at_points(head.template), head.neutral)
    moved = size * (head.at_points(head.shapedirs) @ shape) @ turn.T
    return 0.93 * (head.neutral + moved) @ rotation.exp(np.array([0.05, 0.02, 0])).T + [0, 0.1, -0.9]


def test_the_networks_points_lie_where_they_are_named(actions, head):
    """Corners of eyes and mouth, chin and nose of the template, y up; left is +x."""
    on = head.at_points(head.template)
    assert on[263, 0] > 0.03 > on[133, 0] and on[33, 0] < -0.03
    assert on[10, 1] > on[168, 1] > on[4, 1] > on[13, 1] > on[152, 1]
    assert on[:, 2].argmax() in (1, 4)
    np.testing.assert_allclose(on[actions.mirror] * [-1, 1, 1], on, atol=0.004)


def test_the_head_of_known_points_is_found_whatever_their_place_and_size(head):
    shape = np.random.default_rng(1).normal(0, 1, head.shapedirs.shape[2])
    found = head.arrays(head.fit_shape(as_seen(head, shape))[0])["head_vertices"]
    true = head.template + head.shapedirs @ shape
    face = np.unique(head.corners)

    def apart(a: np.ndarray) -> float:
        turn, size, shift = fit_similarity(a, true[face])
        return float(np.linalg.norm(size * a @ turn.T + shift - true[face], axis=1).mean())

    assert apart(found[face]) < 0.4 * apart(head.template[face])


def test_everybodys_points_give_everybodys_head(head):
    found = head.arrays(head.fit_shape(head.neutral)[0])
    assert np.abs(found["head_vertices"] - found["head_template"]).max() < 1e-3


def test_the_paper_method_lays_it_on_the_open_body_vertex_by_vertex(head):
    body = Body.load()
    shape = np.random.default_rng(2).normal(0, 1, head.shapedirs.shape[2])
    laid = Head.from_arrays(head.arrays(shape), body)
    betas = np.append(shape, np.zeros(body.num_betas - len(shape)))
    true = body.rest(betas)[0][laid.index]
    off = np.linalg.norm(laid.vertices - laid.vertices.mean(0) - true + true.mean(0), axis=1)
    assert len(laid.index) > 1000 and off.mean() < 5e-4
