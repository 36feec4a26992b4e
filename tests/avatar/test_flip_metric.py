"""FLIP against what its formula says of plain images."""

import numpy as np
import pytest

from gsac.avatar.flip_metric import flip


def plain(*colour):
    return np.broadcast_to(np.array(colour, float), (40, 50, 3)).copy()


def test_equal_images_do_not_differ_and_order_does_not_matter():
    rng = np.random.default_rng(0)
    a, b = rng.random((40, 50, 3)), rng.random((40, 50, 3))
    assert flip(a, a).max() == 0
    np.testing.assert_allclose(flip(a, b), flip(b, a))
    assert flip(a, b).min() > 0 and flip(a, b).max() <= 1


def test_green_against_blue_is_the_largest_difference():
    assert flip(plain(0, 1, 0), plain(0, 0, 1)) == pytest.approx(1, abs=1e-6)


def test_black_against_white_of_flat_images_is_the_formula_by_hand():
    """HyAB 100 after Hunt; no feature differs. 100^0.7 lies above the knee of green against blue."""
    lab_green, lab_blue = (87.7347, -86.1827, 83.1793), (32.2970, 79.1875, -107.8602)
    hunt = [(lum, 0.01 * lum * a, 0.01 * lum * b) for lum, a, b in (lab_green, lab_blue)]
    largest = (abs(hunt[0][0] - hunt[1][0]) + np.hypot(hunt[0][1] - hunt[1][1], hunt[0][2] - hunt[1][2])) ** 0.7
    expected = 0.95 + (100**0.7 - 0.4 * largest) / (0.6 * largest) * 0.05
    assert flip(plain(0, 0, 0), plain(1, 1, 1)) == pytest.approx(expected, abs=2e-3)


def test_a_difference_too_fine_for_the_eye_counts_less_from_farther_away():
    chequers = np.indices((64, 64)).sum(0) % 2
    fine = np.repeat(chequers[..., None], 3, 2).astype(float)
    grey = np.full((64, 64, 3), 0.7354)
    assert flip(grey, fine, 200).mean() < 0.8 * flip(grey, fine, 20).mean()


def test_a_thin_line_weighs_more_than_the_same_colour_change_without_an_edge():
    flat, line = plain(0.5, 0.5, 0.5), plain(0.5, 0.5, 0.5)
    line[:, 25] = 0.7
    assert flip(flat, line)[:, 25].mean() > 1.5 * flip(flat, flat + 0.02).mean()
