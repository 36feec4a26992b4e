"""The camera of a truth clip: it looks where it is told, upright, and its frame and the world turn into each other."""

import numpy as np

from gsac.avatar.camera import Camera
from gsac.turntable.viewpoint import Viewpoint, look_at

EYE, TARGET = np.array([0.3, 1.4, 4.0]), np.array([0.0, 0.9, 0.0])


def test_the_target_lies_on_the_optical_axis_and_up_is_up():
    view = Viewpoint(Camera((500.0, 500.0), (45.0, 80.0), 90, 160), look_at(EYE, TARGET), EYE)
    target, above = view.to_camera(np.stack([TARGET, TARGET + [0, 0.1, 0]]))
    np.testing.assert_allclose(target, [0, 0, np.linalg.norm(TARGET - EYE)], atol=1e-12)
    assert abs(above[0]) < 1e-12 and above[1] < 0  # y down, no roll
    np.testing.assert_allclose(np.linalg.det(view.rotation), 1)


def test_camera_and_world_turn_into_each_other():
    view = Viewpoint(Camera((500.0, 500.0), (45.0, 80.0), 90, 160), look_at(EYE, TARGET), EYE)
    points = np.random.default_rng(0).normal(size=(2, 5, 3))
    np.testing.assert_allclose(view.to_world(view.to_camera(points)), points, atol=1e-12)
