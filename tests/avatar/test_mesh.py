import numpy as np
import pytest

from gsac.avatar.mesh import distinct_pairs, vertex_normals


@pytest.mark.parametrize("count", [0, 1, 2, 500])
def test_pairs_come_once_each_and_in_order(count):
    first, second = np.random.default_rng(count).integers(0, 9, (2, count))
    i, j = distinct_pairs(first, second, 9)
    assert list(zip(i, j, strict=True)) == sorted(set(zip(first, second, strict=True)))


def test_a_vertexs_normal_is_weighted_by_area_and_plus_z_without_a_face():
    vertices = np.float32([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1], [9, 9, 9]])
    normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(normals[0], np.array([1, 0, 2]) / np.sqrt(5))
    np.testing.assert_allclose(normals[[1, 3, 4]], [[0, 0, 1], [1, 0, 0], [0, 0, 1]])
