import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.rotation import about_y, align, exp, log, to_wxyz, to_xyzw


def test_a_turn_about_y_takes_z_to_x():
    np.testing.assert_allclose(about_y(np.pi / 2) @ (0, 0, 1), (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(about_y(0.3), exp(np.array([0, 0.3, 0])), atol=1e-15)


def test_the_order_of_quaternions_goes_there_and_back():
    xyzw = Rotation.from_rotvec([[0.1, 0, 0], [0, 2, 0]]).as_quat()
    assert (to_wxyz(xyzw)[:, 0] == xyzw[:, 3]).all()
    np.testing.assert_array_equal(to_xyzw(to_wxyz(xyzw)), xyzw)


def test_log_undoes_exp_and_align_finds_a_turn():
    rng = np.random.default_rng(0)
    vectors, points = rng.normal(size=(5, 3)) * 0.8, rng.normal(size=(9, 3))
    turns = exp(vectors)
    np.testing.assert_allclose(log(turns), vectors, atol=1e-12)
    np.testing.assert_allclose(align(points, points @ turns[0].T + 2), turns[0], atol=1e-12)
