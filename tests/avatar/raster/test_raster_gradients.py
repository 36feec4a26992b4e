"""The kernels against the brute-force reference: image and gradients."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import raster

SCENES = [  # gaussians, width, height, seed, size, opacity
    (60, 67, 45, 0, 0.08, 1.0),
    (300, 33, 65, 1, 0.04, 1.0),
    (150, 31, 31, 2, 0.3, 0.1),
    (2, 1, 3, 3, 0.5, 1.0),
]


def relative(got, wanted):
    return np.abs(got - wanted).max() / np.abs(wanted).max()


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(("real", "bound"), [(np.float64, 1e-9), (np.float32, 1e-4)])
def test_image_and_gradients_agree_with_the_reference(make_scene, scene, real, bound):
    scene = make_scene(*scene)
    rgb, alpha, wanted = scene.reference()
    rendering = raster.render(*(a.astype(real) for a in scene.arguments), scene.camera, low_pass=scene.low_pass)
    got = raster.render_backward(rendering.state, scene.grad_rgb.astype(real), scene.grad_alpha.astype(real))
    assert alpha.max() > 0.02, "the scene shows something"
    assert rendering.rgb.dtype == real
    assert relative(rendering.rgb, rgb) < bound
    assert relative(rendering.alpha, alpha) < bound
    for name, g, w in zip(raster.Gradients._fields, got, wanted, strict=True):
        assert relative(g, w) < bound, name


def test_opaque_layers_stop_the_compositing_as_in_the_reference(make_scene):
    scene = make_scene(80, 40, 40, 5, 0.4)
    scene.arguments[4][:] = 1.5  # alpha is capped at 0.999 near every centre
    _, alpha, wanted = scene.reference()
    assert (1 - alpha < 1.1e-2).any() and (1 - alpha > 1e-4).all()
    rendering = raster.render(*scene.arguments, scene.camera, low_pass=scene.low_pass)
    got = raster.render_backward(rendering.state, scene.grad_rgb, scene.grad_alpha)
    for name, g, w in zip(raster.Gradients._fields, got, wanted, strict=True):
        assert relative(g, w) < 1e-9, name


def test_jacobian_clamp_outside_the_frustum_has_the_references_gradient(make_scene):
    scene = make_scene(40, 48, 32, 6, 0.5)
    scene.arguments[0][:, 0] += np.where(np.arange(40) % 2, 1.6, -1.6)
    _, alpha, wanted = scene.reference()
    assert alpha.max() > 0.1
    rendering = raster.render(*scene.arguments, scene.camera, low_pass=scene.low_pass)
    got = raster.render_backward(rendering.state, scene.grad_rgb, scene.grad_alpha)
    assert relative(got.means, wanted[0]) < 1e-9
