"""Directions lie all round, none much nearer to its neighbour than the others to theirs."""

import numpy as np
import pytest

from gsac.avatar.directions import spread_directions


@pytest.mark.parametrize("ahead", [0, 0.5])
def test_directions_are_unit_vectors_evenly_spread_all_round(ahead):
    ways = spread_directions(100, ahead)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1)
    assert np.abs(ways.mean(0)).max() < 0.01
    nearest = np.arccos(np.sort(ways @ ways.T, 1)[:, -2])
    assert nearest.min() > 0.75 * np.sqrt(4 * np.pi / 100) and nearest.max() < 1.1 * np.sqrt(4 * np.pi / 100)


def test_the_turn_that_goes_ahead_is_about_z_alone():
    steps = spread_directions(9), spread_directions(9, 0.5)
    np.testing.assert_array_equal(steps[0][:, 2], steps[1][:, 2])
    turned = [np.arctan2(ways[:, 1], ways[:, 0]) for ways in steps]
    np.testing.assert_allclose(np.exp(1j * (turned[1] - turned[0])), np.exp(0.5j * np.pi * (1 + 5**0.5)))
