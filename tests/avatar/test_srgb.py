import numpy as np

from gsac.avatar.srgb import to_display, to_linear


def test_black_white_and_the_standards_middle_are_what_the_standard_says():
    np.testing.assert_allclose(to_linear(np.array([0, 0.04045, 0.5, 1])), [0, 0.04045 / 12.92, 0.2140411, 1], atol=1e-7)


def test_both_ways_give_the_value_again_and_keep_below_zero_straight():
    display = np.linspace(-0.2, 1.2, 1401)
    np.testing.assert_allclose(to_display(to_linear(display)), display, atol=1e-6)
    assert to_linear(np.float32(-0.1)) == np.float32(-0.1) / np.float32(12.92)


def test_float32_stays_float32():
    assert to_linear(np.float32([0.2, 0.8])).dtype == to_display(np.float32([0.2, 0.8])).dtype == np.float32
