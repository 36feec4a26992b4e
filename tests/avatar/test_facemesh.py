import numpy as np
import pytest

from gsac.avatar.facemesh import IBUG68, LEFT_SIDE, POINTS, RIGHT_SIDE, Face, head_yaw, region_of
from support.regions import to_region


def ball(yaw: float) -> Face:
    """Points spread over a head's front half, turned; the two sides at its ends."""
    random = np.random.default_rng(0).normal(size=(POINTS, 3))
    points = random / np.linalg.norm(random, axis=1, keepdims=True)
    points[:, 2] = -np.abs(points[:, 2])
    points[RIGHT_SIDE], points[LEFT_SIDE] = (-1, 0, 0), (1, 0, 0)
    turn = np.array([[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]])
    return Face(points @ turn.T * 50 + [200, 100, 0], 1.0)


@pytest.mark.parametrize("yaw", [-0.7, 0.0, 0.4])
def test_a_meshs_yaw_is_that_of_its_head(yaw):
    assert ball(yaw).yaw == pytest.approx(yaw)


def test_points_on_the_far_side_of_a_turned_head_do_not_face_the_camera():
    frontal, turned = ball(0.0), ball(1.0)
    assert frontal.facing().min() >= 0.99
    x = frontal.points[:, 0] - 200
    assert turned.facing()[x > 40].mean() < 0.4 and turned.facing()[x < -20].min() == 1


def test_yaw_of_the_bodys_head_points_to_where_the_nose_goes():
    world = np.zeros((11, 3))
    world[7], world[8] = (0.07, 0, 0), (-0.07, 0, 0)
    world[0] = (0.1, 0, -0.1)
    assert head_yaw(world) == pytest.approx(np.pi / 4)
    world[0] = (0, 0, 0.1)
    assert abs(head_yaw(world)) == pytest.approx(np.pi)


def test_the_meshs_own_region_levels_the_eyes_and_holds_every_point():
    face = ball(0.2)
    region = region_of(face.points)
    inside = to_region(region, face.points[:, :2])
    assert inside.min() > 0 and inside.max() < 1
    eyes = to_region(region, face.points[[33, 263], :2])
    assert eyes[0, 1] == pytest.approx(eyes[1, 1])


def test_each_ibug_point_has_one_mesh_point():
    assert len(set(IBUG68)) == 68 and IBUG68.min() >= 0 and IBUG68.max() < POINTS
