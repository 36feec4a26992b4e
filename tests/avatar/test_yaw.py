import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.yaw import name_side, turn_seen, yaw


def turning(degrees):
    """(T, 3, 3) of a body that stands upright before the camera and turns."""
    turned = Rotation.from_rotvec(np.radians(np.asarray(degrees, float))[:, None] * [0.0, 1.0, 0.0]).as_matrix()
    return np.diag([1.0, -1.0, -1.0]) @ turned


def test_the_yaw_is_zero_facing_the_camera_and_grows_to_the_bodys_left():
    np.testing.assert_allclose(np.degrees(yaw(turning([0, 30, 90, -120, 179]))), [0, 30, 90, -120, 179], atol=1e-9)


@pytest.mark.parametrize(("degrees", "seen"), [([0, 90, 180, 270], 270), ([170, 180, 190, 200], 30), ([20], 0),
                                               (np.arange(0, 360, 6), 354), ([-5, 5], 10)])
def test_the_turn_seen_is_all_but_the_widest_gap_also_across_the_back(degrees, seen):
    assert turn_seen(turning(degrees)) == pytest.approx(seen, abs=1e-6)


def test_no_frame_shows_no_turn():
    assert turn_seen(np.zeros((0, 3, 3))) == 0


def test_one_frame_covers_nothing_and_never_less():
    assert [f"{turn_seen(turning([degrees])):.0f}" for degrees in np.linspace(0, 359, 50)] == ["0"] * 50


def test_the_side_that_the_camera_sees_has_a_name():
    """Turned to the own left, a body shows its right side."""
    seen = [name_side(angle) for angle in yaw(turning([0, 40, 90, 179, -179, -90, -40]))]
    assert seen == ["front", "front", "right side", "back", "back", "left side", "front"]
