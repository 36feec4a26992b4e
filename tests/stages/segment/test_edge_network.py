"""The edge network on painted pictures whose truth is known; `test_segment_stage.py` judges it on a rendered person."""

import cv2
import numpy as np
import pytest

from gsac.stages.segment.edge_network import AROUND, BAND, CloseUp, find_alpha
from gsac.stages.segment.plate import Plate

SIZE = HEIGHT, WIDTH = 480, 320


def wall():
    """(H, W, 3) float: textured, darker to one side."""
    texture = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 36, (*SIZE, 1)).astype(np.float32), (0, 0), 3)[..., None]
    return np.array((150, 150, 140)) + texture + np.linspace(-15, 15, WIDTH)[None, :, None]


def figure():
    """(H, W) 0..1, anti-aliased: trunk, head, a spread arm."""
    big = np.zeros((HEIGHT * 8, WIDTH * 8), np.uint8)
    cv2.ellipse(big, (160 * 8, 280 * 8), (52 * 8, 140 * 8), 0, 0, 360, 255, -1)
    cv2.circle(big, (160 * 8, 104 * 8), 34 * 8, 255, -1)
    cv2.line(big, (160 * 8, 200 * 8), (280 * 8, 300 * 8), 255, 20 * 8)
    return cv2.resize(big, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA) / np.float32(255)


def painted(alpha, background=None, person=(40, 60, 130), noise=1.0, seed=1):
    background = wall() if background is None else background
    mix = alpha[..., None] * np.array(person) + (1 - alpha[..., None]) * background
    return np.clip(mix + np.random.default_rng(seed).normal(0, noise, mix.shape), 0, 255).astype(np.uint8)


def rough(alpha):
    """(H, W) uint8, what the body network would say."""
    return (cv2.GaussianBlur(alpha, (0, 0), 8) * 255).astype(np.uint8)


def plate():
    return Plate(painted(np.zeros(SIZE), seed=5), np.ones(SIZE, bool))


def close_up(image, outline, probability, scene, lost=None):
    return CloseUp(image, outline, probability, scene, np.zeros(outline.shape, bool) if lost is None else lost)


def cost(alpha):
    return ((alpha - figure()) ** 2).sum()


def moved(outline, by):
    """The outline grown by so many px, or shrunk."""
    change = cv2.dilate if by > 0 else cv2.erode
    return change(outline.astype(np.uint8), np.ones((2 * abs(by) + 1,) * 2, np.uint8)) > 0


@pytest.mark.parametrize("scene", [None, plate()])
def test_the_edge_is_nearer_to_the_share_of_the_person_in_a_pixel_than_the_outline(scene):
    truth = figure()
    alpha = find_alpha(close_up(painted(truth), truth > 0.5, rough(truth), scene))
    assert cost(alpha) < 0.6 * cost(truth > 0.5)
    assert alpha.dtype == np.float32 and alpha.min() >= 0 and alpha.max() <= 1


@pytest.mark.parametrize("by", [-5, -3, 3, 5])
def test_an_outline_that_is_off_is_brought_back_to_the_person(by):
    truth = figure()
    outline = moved(truth > 0.5, by)
    assert cost(find_alpha(close_up(painted(truth), outline, rough(truth), plate()))) < 0.08 * cost(outline)


def test_a_slit_that_the_outline_fills_opens():
    truth = figure()
    truth[240:320, 118:122] = 0
    filled = cv2.morphologyEx((truth > 0.5).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)) > 0
    alpha = find_alpha(close_up(painted(truth), filled, rough(truth), plate()))
    assert filled[245:315, 118:122].all() and alpha[245:315, 118:122].mean() < 0.35


def test_where_both_sides_look_alike_the_edge_stays_near_the_outline():
    truth, grey = figure(), np.full((*SIZE, 3), 120.0)
    outline = truth > 0.5
    scene = Plate(painted(np.zeros(SIZE), grey, seed=5), np.ones(SIZE, bool))
    alpha = find_alpha(close_up(painted(truth, grey, (120, 120, 120)), outline, rough(truth), scene))
    assert ((alpha > 0.5) & outline).sum() / ((alpha > 0.5) | outline).sum() > 0.93


def test_far_from_the_outline_alpha_is_the_outlines():
    truth = figure()
    outline = truth > 0.5
    image = painted(truth)
    image[20:60, 20:60] = image[300:340, 140:180] = (200, 30, 30)  # a stranger, and a hole as if the scene were red there
    alpha = find_alpha(close_up(image, outline, rough(truth), plate()))
    near = cv2.dilate(outline.astype(np.uint8), np.ones((2 * BAND + 1,) * 2, np.uint8)) > 0
    deep = cv2.erode(outline.astype(np.uint8), np.ones((2 * BAND + 1,) * 2, np.uint8)) > 0
    assert not alpha[~near].any() and (alpha[deep] == 1).all() and deep[300:340, 140:180].all()


@pytest.mark.parametrize("scene", [None, plate()])
def test_what_the_outline_has_lost_comes_back_however_far_from_its_edge(scene):
    truth = figure()
    outline = truth > 0.5
    outline[250:350] = False
    outline[360:480, :170] = False
    lost = (truth > 0.5) & ~outline
    alpha, without = (find_alpha(close_up(painted(truth), outline, rough(truth), scene, *more)) for more in ((lost,), ()))
    assert cost(alpha) < 0.1 * cost(without)


def test_what_lies_beyond_the_part_that_it_sees_changes_nothing():
    truth = figure()
    seen = close_up(painted(truth), truth > 0.5, rough(truth), plate())
    rows, columns = np.flatnonzero(seen.outline.any(1)), np.flatnonzero(seen.outline.any(0))
    part = np.s_[rows[0] - AROUND: rows[-1] + AROUND + 1, columns[0] - AROUND: columns[-1] + AROUND + 1]
    scene = Plate(seen.scene.image[part], seen.scene.known[part])
    cut = close_up(seen.image[part], seen.outline[part], seen.probability[part], scene)
    assert np.array_equal(find_alpha(seen)[part], find_alpha(cut))


def test_nobody_gives_an_empty_alpha_and_a_sliver_of_a_picture_one_of_its_size():
    image = painted(figure())
    empty = np.zeros(SIZE, bool)
    assert not find_alpha(close_up(image, empty, empty.astype(np.uint8), None)).any()
    sliver = close_up(image[200:203, 100:220], figure()[200:203, 100:220] > 0.5, rough(figure())[200:203, 100:220], None)
    assert find_alpha(sliver).shape == (3, 120)
