"""Bitwise the same for any number of threads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar import losses, raster
from gsac.avatar.gaussians import Gaussians


@pytest.mark.parametrize("workers", [2, 3])
def test_image_gradients_and_losses_do_not_depend_on_the_number_of_threads(make_scene, workers):
    scene = make_scene(400, 131, 97, 4)
    random = np.random.default_rng(0)
    vertices = scene.arguments[0].astype(np.float32)
    faces = random.integers(0, 400, (200, 3)).astype(np.int32)
    gaussians = Gaussians(random.integers(0, 200, 400).astype(np.int32), random.normal(size=(400, 3)).astype(np.float32) * 0.01,
                          random.normal(size=(400, 4)).astype(np.float32), np.full((400, 3), -6, np.float32),
                          scene.arguments[3].astype(np.float32), scene.arguments[4].astype(np.float32))
    results = []
    for count in (1, workers):
        workspace = raster.Workspace(count)
        rendering = raster.render_bound(vertices, faces, replace(gaussians, low_pass=scene.low_pass), scene.camera, workspace)
        target = np.random.default_rng(1).random(rendering.rgb.shape).astype(np.float32)
        gradient = np.zeros_like(target)
        values = [loss(rendering.rgb, target, box=(3, 90, 5, 120), gradient=gradient, workspace=workspace).value
                  for loss in (losses.l2, losses.ssim, losses.sobel)]
        back = raster.render_bound_backward(rendering.state, gradient, scene.grad_alpha)
        results.append([rendering.rgb, rendering.alpha, gradient, np.array(values), *back])
    assert results[0][1].max() > 0.5
    for one, many in zip(*results, strict=True):
        assert one.tobytes() == many.tobytes()


def test_a_step_repeats_bit_by_bit(make_scene):
    scene = make_scene(300, 64, 64, 9)
    arguments = [a.astype(np.float32) for a in scene.arguments]
    states = [raster.render(*arguments, scene.camera, low_pass=scene.low_pass).state for _ in range(2)]
    first, second = (raster.render_backward(state, scene.grad_rgb, scene.grad_alpha) for state in states)
    for a, b in zip(first, second, strict=True):
        assert a.tobytes() == b.tobytes()
