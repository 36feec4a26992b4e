"""The viewer bends an avatar's surface as the Python body does."""

import numpy as np

from support.bending import pose_in_viewer


def test_a_bent_elbow_lies_where_the_python_body_has_it(bent_arm, tmp_path):
    got = pose_in_viewer(bent_arm.file, bent_arm.pose, tmp_path)
    assert np.linalg.norm(got["vertices"] - bent_arm.vertices, axis=1).max() < 1e-4, "0.1 mm"
    np.testing.assert_array_equal(got["rest"].astype(np.float32), bent_arm.avatar.vertices, "the T-pose has none")
    assert np.linalg.norm(bent_arm.plain - bent_arm.vertices, axis=1).max() > 5e-3, "plain skinning is far off"
