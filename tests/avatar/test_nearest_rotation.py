"""Quaternions of matrices that rounding has made almost rotations."""

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.nearest_rotation import nearest_quaternions


def test_they_are_those_of_the_nearest_rotation_by_singular_values():
    turns = Rotation.random(3000, random_state=1).as_matrix()
    half_turns = [np.eye(3), *(np.diag(np.roll([1.0, -1.0, -1.0], k)) for k in range(3))]
    for matrices in (turns, np.float32(turns) @ np.float32(turns[::-1]), turns + 1e-4 * turns[::-1], np.array(half_turns)):
        wanted = Rotation.from_matrix(matrices).as_quat()[:, [3, 0, 1, 2]]
        np.testing.assert_allclose(nearest_quaternions(matrices), wanted, atol=1e-14)
