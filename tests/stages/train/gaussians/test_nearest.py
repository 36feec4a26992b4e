"""Nearest neighbours among all places, or among some of them."""

import numpy as np

from gsac.stages.train.gaussians.nearest import find_nearest, find_nearest_among

PLACES = np.array([[0.0], [1], [2.5], [4.5], [7]])


def test_no_more_neighbours_are_found_than_there_are_places():
    assert find_nearest(PLACES, np.array([[4.0]]), 2).tolist() == [[3, 2]]
    assert find_nearest(PLACES, np.array([[4.0]]), 9).tolist() == [[3, 2, 1, 4, 0]]


def test_neighbours_among_some_places_are_told_by_their_numbers_among_all():
    assert find_nearest_among(PLACES, np.array([4, 1, 0]), np.array([2, 3]), 2).tolist() == [[1, 0], [4, 1]]
