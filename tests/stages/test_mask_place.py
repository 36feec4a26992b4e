"""A mask that does not lie where the person is is told from one that does."""

import numpy as np
import pytest

from gsac.stages.mask_place import HELD, share_held


@pytest.fixture
def person():
    """(160, 96) bool mask of a standing box, and its points (133, 2) px with their scores (133,)."""
    mask = np.zeros((160, 96), bool)
    mask[20:140, 36:60] = True
    xy = np.zeros((133, 2))
    xy[:17] = np.stack([np.tile([40.0, 48, 56], 6)[:17], np.linspace(24, 136, 17)], 1)
    return mask, xy, np.full(133, 0.9)


def test_a_mask_in_its_place_holds_the_points_at_any_size(person):
    mask, xy, score = person
    assert share_held(mask, xy, score) == share_held(mask[::2, ::2], xy, score, 2.0) == 1


def test_a_mask_that_is_inverted_or_shifted_by_much_does_not(person):
    mask, xy, score = person
    assert share_held(~mask, xy, score) == 0
    assert share_held(np.roll(mask, 30, 1), xy, score) < HELD < share_held(np.roll(mask, 6, 1), xy, score)


def test_faint_points_points_outside_and_empty_masks_tell_nothing(person):
    mask, xy, score = person
    assert np.isnan(share_held(mask & False, xy, score)) and np.isnan(share_held(mask, xy, 0.3 * score))
    assert np.isnan(share_held(mask, xy + [0, 200], score)) and np.isnan(share_held(mask, xy * np.nan, 0 * score))
    xy[10:17] += 200
    assert share_held(mask, xy, score) == 1, "what the picture's edge cuts off is no point beside the mask"
