import dataclasses

import numpy as np
import pytest

from gsac.avatar.region import Region
from gsac.stages.keypoints.hands import Arm, Hand, assign, distinct, merged, rough_region, same_hand
from support.regions import to_region

SHAPE = np.random.default_rng(1).uniform(0, 60, (21, 2)) - [30, 0]
SHAPE[0] = 0


def hand(x: float, y: float, right: float = 0.5, presence: float = 0.9) -> Hand:
    return Hand(SHAPE + [x, y], np.zeros((21, 3)), presence, right)


def arm(x: float, y: float) -> Arm:
    wrist = np.array([x, y], float)
    return Arm(wrist, wrist + [-10, 30], wrist + [10, 30], 100.0)


ARMS = {"left": arm(300, 200), "right": arm(100, 200)}


def test_each_arm_gets_the_hand_at_its_wrist():
    given = assign([hand(105, 195), hand(295, 205)], ARMS, 0.5)
    assert given["right"].points[0].tolist() == [105, 195] and given["left"].points[0].tolist() == [295, 205]


def test_a_hidden_hand_does_not_get_the_other_hands_points():
    crossed = {"left": arm(130, 200), "right": arm(100, 200)}
    given = assign([hand(102, 200, right=0.9)], crossed, 0.5)
    assert set(given) == {"right"}


def test_the_side_the_network_sees_decides_between_two_close_wrists():
    crossed = {"left": arm(112, 200), "right": arm(100, 200)}
    assert set(assign([hand(105, 200, right=0.05)], crossed, 0.5)) == {"left"}
    assert set(assign([hand(107, 200, right=0.95)], crossed, 0.5)) == {"right"}


def test_a_hand_far_from_both_wrists_is_nobodys():
    assert assign([hand(200, 200)], ARMS, 0.5) == {}


def test_two_finds_of_one_hand_are_one_and_two_hands_stay_two():
    near, surer = hand(100, 200, presence=0.6), hand(104, 200, presence=0.9)
    assert same_hand(near, surer)
    one, other = merged([near, surer, hand(160, 200, presence=0.7)])
    assert one.presence == 0.9 and one.points[0, 0] == pytest.approx((0.6 * 100 + 0.9 * 104) / 1.5)
    assert other.points[0, 0] == pytest.approx(160)


def test_looks_at_nearly_the_same_square_are_made_once():
    a = Region((100.0, 100.0), 80.0, 3.1)
    again = dataclasses.replace(a, center=(101.0, 100.0), angle=-3.12)
    assert distinct([a, again, dataclasses.replace(a, side=120.0)]) == [a, dataclasses.replace(a, side=120.0)]


def test_rough_region_has_the_fingers_up_and_survives_points_that_coincide():
    region = rough_region(np.array([100.0, 100]), np.array([140.0, 95]), np.array([140.0, 105]))
    knuckle, wrist = to_region(region, np.array([[140.0, 100], [100.0, 100]]))
    assert knuckle[1] < wrist[1] and abs(knuckle[0] - wrist[0]) < 0.05
    assert rough_region(*np.full((3, 2), 50.0)).side > 0
