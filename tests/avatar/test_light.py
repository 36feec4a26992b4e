import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar import artifacts, light, raster
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster.lit import shade_faces
from gsac.avatar.threads import Workspace

LAMP = np.array([[0.8, 0.8, 0.9], [0.3, 0.2, 0.3], [-0.1, -0.1, 0.0], [-0.2, -0.3, -0.2]])


@pytest.fixture
def triangle():
    """A mesh that looks at the camera, and gaussians on it."""
    vertices = np.array([[-0.5, 0.5, 2], [0.5, 0.5, 2.2], [0, -0.5, 2]])
    random = np.random.default_rng(0)
    gaussians = Gaussians.area(vertices, np.array([[0, 1, 2]]), 20)
    gaussians.rgb = random.uniform(0.1, 0.5, (20, 3))
    return vertices, np.array([[0, 1, 2]], np.int32), gaussians, Camera((60, 60), (16, 16), 32, 32)


def test_what_looks_away_is_lit_as_what_looks_to_the_camera():
    normals = np.array([[0.6, 0, 0.8], [0.6, 0, -0.8]])
    there, away = light.shade(LAMP, normals)
    assert np.array_equal(there, away) and not np.allclose(there, light.shade(LAMP, normals[:1] * [-1, 1, 1]))


def test_a_lit_gaussian_is_drawn_in_its_colour_times_the_shade(triangle):
    vertices, faces, gaussians, camera = triangle
    normal = np.cross(vertices[2] - vertices[1], vertices[0] - vertices[1])
    shade = light.shade(LAMP, normal[None] / np.linalg.norm(normal) * [1, -1, -1])
    gaussians.light = LAMP
    lit = raster.render_bound(vertices, faces, gaussians, camera)
    gaussians.rgb, gaussians.light = gaussians.rgb * shade, None
    assert np.allclose(lit.rgb, raster.render_bound(vertices, faces, gaussians, camera).rgb, atol=1e-12)
    assert not np.allclose(shade, 1, atol=0.05)


def test_the_gradient_of_a_lit_colour_is_that_of_a_linear_image(triangle):
    vertices, faces, gaussians, camera = triangle
    gaussians.light = LAMP
    rendering = raster.render_bound(vertices, faces, gaussians, camera)
    grad = np.random.default_rng(2).normal(size=rendering.rgb.shape)
    image = (grad * rendering.rgb).sum()
    grads = raster.render_bound_backward(rendering.state, grad, np.zeros(rendering.alpha.shape))
    assert np.isclose((grads.rgb * gaussians.rgb).sum(), image, rtol=1e-12)


def test_the_file_keeps_the_light_and_a_file_without_one_has_none(triangle, tmp_path):
    gaussians = triangle[2]
    gaussians.write(tmp_path / "even.npz")
    assert Gaussians.read(tmp_path / "even.npz").light is None
    gaussians.light = LAMP
    gaussians.write(tmp_path / "lit.npz")
    again = Gaussians.read(tmp_path / "lit.npz")
    assert np.allclose(again.light, LAMP) and np.allclose(again[:5].light, LAMP)


@pytest.mark.parametrize(("wrong", "word"), [(np.ones((3, 3)), "light has shape"),
                                             (np.full((4, 3), np.nan), "light is not finite")])
def test_a_file_with_a_wrong_light_is_refused_by_name(triangle, tmp_path, wrong, word):
    gaussians = triangle[2]
    gaussians.light = wrong
    gaussians.write(tmp_path / "avatar.npz")
    with pytest.raises(artifacts.ArtifactError, match=word):
        Gaussians.read(tmp_path / "avatar.npz")


def test_faces_are_lit_as_their_normals_are():
    R = Rotation.random(50, random_state=2).as_matrix().astype(np.float32)
    face = np.random.default_rng(3).integers(0, 50, 200)
    lit = light.shade(LAMP, R[face, :, 1] * light.FROM_CAMERA)
    np.testing.assert_array_equal(shade_faces(LAMP, R, face, Workspace()), lit)
