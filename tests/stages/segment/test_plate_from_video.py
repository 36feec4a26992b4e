"""The plate that the frames of a video show behind the person."""

import numpy as np
import pytest

from gsac.stages.segment.plate_from_video import masked_median, sort_first_axis


@pytest.mark.parametrize("count", [1, 2, 5, 24])
def test_values_are_sorted_as_by_numpy(count):
    values = np.random.default_rng(count).integers(0, 256, (count, 7, 5)).astype(np.uint8)
    expected = np.sort(values, axis=0)
    sort_first_axis(values)
    np.testing.assert_array_equal(values, expected)


def test_a_pixel_of_the_plate_is_the_lower_median_of_the_frames_that_show_the_scene_there():
    rng = np.random.default_rng(0)
    images, free = rng.integers(0, 256, (9, 70, 6, 3)).astype(np.uint8), rng.random((9, 70, 6)) < 0.6
    free[0] = True
    plate = masked_median(images, free)
    for row, column in np.ndindex(70, 6):
        shown = np.sort(images[free[:, row, column], row, column], axis=0)
        np.testing.assert_array_equal(plate.image[row, column], shown[(len(shown) - 1) // 2])
