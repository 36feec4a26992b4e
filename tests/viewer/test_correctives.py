"""The viewer bends an avatar's surface as the Python body does."""

import numpy as np

from support.bending import pose_in_viewer


def test_a_bent_elbow_lies_where_the_python_body_has_it(bent_arm, tmp_path):
    got = pose_in_viewer(bent_arm.file, bent_arm.pose, tmp_path)
    assert np.linalg.norm(got["vertices"] - bent_arm.vertices, axis=1).max() < 1e-4, "0.1 mm"
    assert np.linalg.norm(bent_arm.plain - bent_arm.vertices, axis=1).max() > 5e-3, "plain skinning is far off"


def test_the_t_pose_has_none_and_the_graphics_card_is_sent_the_bent_rest(bent_arm, tmp_path):
    got = pose_in_viewer(bent_arm.file, bent_arm.pose, tmp_path)
    np.testing.assert_array_equal(got["rest"].astype(np.float32), bent_arm.avatar.vertices)
    moved = bent_arm.avatar.vertices + bent_arm.avatar.correctives.move_rest(bent_arm.pose)
    np.testing.assert_allclose(got["bent"], np.pad(moved, ((0, 0), (0, 1)), constant_values=1), atol=2e-5)
