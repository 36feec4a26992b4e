import numpy as np
import pytest

from gsac.stages.train.gaussians.light_from_above import TRUST, USUAL, find_from_above

SHIRT, TROUSERS = np.array([0.6, 0.3, 0.2]), np.array([0.2, 0.25, 0.5])


def dressed(slope, seed=0, count=4000):
    """Colours, upward normals and places of a red shirt over blue trousers, both round, each checked, in a light of that slope."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    upper = np.arange(count) % 2 == 0
    places = 0.25 * normals + np.where(upper[:, None], [0, 0.4, 0], [0, -0.4, 0])
    checks = random.choice([0.6, 1.0], count)
    up = normals[:, 1]
    paint = np.where(upper[:, None], SHIRT, TROUSERS) * checks[:, None]
    return paint * np.exp(slope * up)[:, None], up, places


@pytest.mark.parametrize("slope", [-0.1, 0.0, 0.3])
def test_undersides_darker_than_what_faces_up_tell_the_light_from_above(slope):
    assert find_from_above(*dressed(slope)) == pytest.approx(TRUST * slope + (1 - TRUST) * USUAL, abs=0.05)


def test_dark_trousers_under_a_light_shirt_are_paint():
    rgb, up, places = dressed(0.0)
    rgb[places[:, 1] < 0] *= 0.4
    assert find_from_above(rgb, up, places) == pytest.approx((1 - TRUST) * USUAL, abs=0.05)


def test_a_white_print_on_what_faces_up_is_an_outlier():
    rgb, up, places = dressed(0.0)
    rgb[up > 0.93] = 0.9
    assert find_from_above(rgb, up, places) == pytest.approx((1 - TRUST) * USUAL, abs=0.05)


def test_too_few_places_say_nothing():
    assert find_from_above(np.full((9, 3), 0.5), np.zeros(9), np.zeros((9, 3))) == USUAL
