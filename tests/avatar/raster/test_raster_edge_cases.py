"""Input that a training run can meet: nothing may become NaN, and what is not seen gets no gradient."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import raster
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians


def run(scene, real=np.float32):
    rendering = raster.render(*(a.astype(real) for a in scene.arguments), scene.camera, low_pass=scene.low_pass)
    gradients = raster.render_backward(rendering.state, scene.grad_rgb.astype(real), scene.grad_alpha.astype(real))
    for array in (rendering.rgb, rendering.alpha, *gradients):
        assert np.isfinite(array).all()
    return rendering, gradients


@pytest.mark.parametrize(("position", "why"), [
    ((0, 0, -1), "behind"), ((0, 0, 0), "at the camera"), ((0, 0, 0.005), "before the near plane"), ((50, 0, 2), "beside"),
    ((np.nan, 0, 2), "nowhere"), ((0, 0, np.inf), "infinitely far"),
])
def test_a_gaussian_that_is_not_seen_changes_nothing_and_gets_no_gradient(make_scene, position, why):
    scene = make_scene(30, 40, 24, 0)
    without = run(scene)[0]
    wanted_rgb, wanted_alpha = without.rgb.copy(), without.alpha.copy()
    extra = (np.array([position], float), np.eye(3)[None], np.full((1, 3), 0.01), np.ones((1, 3)), np.ones(1))
    scene.arguments = tuple(np.concatenate(pair) for pair in zip(scene.arguments, extra, strict=True))
    rendering, gradients = run(scene)
    assert np.array_equal(rendering.rgb, wanted_rgb) and np.array_equal(rendering.alpha, wanted_alpha)
    for g in gradients:
        assert not g[-1].any(), why


@pytest.mark.parametrize("scale", [0.0, 1e-30, 1e-8, 1e3, 1e12, 1e30, np.inf])
def test_no_scale_makes_a_nan(make_scene, scale):
    scene = make_scene(30, 40, 24, 0)
    scene.arguments[2][::3] = scale
    scene.arguments[2][1::3, 1] = scale
    run(scene)


def test_a_gaussian_without_extent_is_not_drawn_or_a_blurred_dot_with_the_references_gradient(make_scene):
    scene = make_scene(40, 40, 24, 1)
    scene.arguments[2][:] = 0
    if scene.low_pass.keeps_energy:
        rendering = raster.render(*scene.arguments, scene.camera, low_pass=scene.low_pass)
        assert rendering.alpha.max() == 0
        assert all((grad == 0).all() for grad in raster.render_backward(rendering.state, scene.grad_rgb, scene.grad_alpha))
        return
    rgb, _, wanted = scene.reference()
    rendering = raster.render(*scene.arguments, scene.camera, low_pass=scene.low_pass)
    got = raster.render_backward(rendering.state, scene.grad_rgb, scene.grad_alpha)
    assert rgb.max() > 0.1
    assert np.abs(rendering.rgb - rgb).max() < 1e-12
    assert np.abs(got.means - wanted[0]).max() < 1e-9 * np.abs(wanted[0]).max()


@pytest.mark.parametrize("opacity", [0.0, 0.003, -1.0, np.nan])
def test_too_transparent_gaussians_are_left_out(make_scene, opacity):
    scene = make_scene(30, 40, 24, 0)
    scene.arguments[4][:] = opacity
    rendering, gradients = run(scene)
    assert not rendering.alpha.any() and not gradients.rgb.any()


def test_no_gaussian_at_all_gives_an_empty_image():
    nothing = [np.empty(shape, np.float32) for shape in ((0, 3), (0, 3, 3), (0, 3), (0, 3), (0,))]
    rendering = raster.render(*nothing, Camera((20, 20), (8, 8), 17, 15))
    gradients = raster.render_backward(rendering.state, np.ones((15, 17, 3)), np.ones((15, 17)))
    assert rendering.rgb.shape == (15, 17, 3) and not rendering.rgb.any() and gradients.means.shape == (0, 3)


def test_a_gaussian_on_a_zero_area_face_stays_finite():
    vertices = np.array([[0, 0, 2], [0.1, 0, 2], [0, 0.1, 2], [0.05, 0.05, 2]], np.float32)
    faces = np.array([[0, 1, 2], [1, 1, 1], [1, 3, 2]], np.int32)
    gaussians = Gaussians(np.array([0, 1, 2], np.int32), np.zeros((3, 3)), np.array([[1.0, 0, 0, 0], [1, 0, 0, 0], [0] * 4]),
                          np.full((3, 3), -3.0), np.ones((3, 3)), np.full(3, 0.9))
    rendering = raster.render_bound(vertices, faces, gaussians, Camera((100, 100), (10, 10), 23, 23))
    gradients = raster.render_bound_backward(rendering.state, np.ones((23, 23, 3)), np.ones((23, 23)))
    assert rendering.alpha.max() > 0.3
    for name, g in zip(raster.BoundGradients._fields, gradients, strict=True):
        assert np.isfinite(g).all(), name
    assert not gradients.log_scale[1].any() and not gradients.quat[2].any()


def test_a_workspace_can_be_used_for_other_sizes_and_precisions(make_scene):
    workspace = raster.Workspace(1)
    for count, width, height, real in ((50, 40, 24, np.float32), (9, 65, 90, np.float32), (70, 33, 20, np.float64)):
        scene = make_scene(count, width, height, count)
        arguments = [a.astype(real) for a in scene.arguments]
        fresh = raster.render(*arguments, scene.camera, low_pass=scene.low_pass)
        again = raster.render(*arguments, scene.camera, workspace, scene.low_pass)
        assert np.array_equal(fresh.rgb, again.rgb)
        for a, b in zip(raster.render_backward(fresh.state, scene.grad_rgb, scene.grad_alpha),
                        raster.render_backward(again.state, scene.grad_rgb, scene.grad_alpha), strict=True):
            assert np.array_equal(a, b)
