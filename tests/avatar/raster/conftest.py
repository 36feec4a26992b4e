"""Random gaussians before a camera, and what the brute-force float64 reference says about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import ADDED, PIXEL, LowPass


@dataclass
class Scene:
    arguments: tuple[np.ndarray, ...]
    """means, rotations, scales, rgb, opacity in float64."""
    camera: Camera
    grad_rgb: np.ndarray
    grad_alpha: np.ndarray
    low_pass: LowPass

    def reference(self):
        """rgb, alpha and the five gradients by torch autograd in float64."""
        import torch

        from gsac.avatar.raster import reference

        tensors = [torch.tensor(a, requires_grad=True) for a in self.arguments]
        rgb, alpha = reference.render(*tensors, self.camera, self.low_pass)
        ((rgb * torch.tensor(self.grad_rgb)).sum() + (alpha * torch.tensor(self.grad_alpha)).sum()).backward()
        return rgb.detach().numpy(), alpha.detach().numpy(), [t.grad.numpy() for t in tensors]


@pytest.fixture(params=[ADDED, PIXEL], ids=["added", "pixel"])
def make_scene(request):
    def make(count: int, width: int, height: int, seed: int, size: float = 0.08, opacity: float = 1.0) -> Scene:
        random = np.random.default_rng(seed)
        means = random.normal(size=(count, 3)) * (0.5, 0.45, 0.4) + (0, 0, 2.2)
        rotations = Rotation.random(count, random_state=seed).as_matrix()
        scales = size * np.exp(0.7 * random.normal(size=(count, 3)))
        camera = Camera((1.05 * width, 1.1 * width), (0.49 * width, 0.53 * height), width, height)
        return Scene((means, rotations, scales, random.random((count, 3)), opacity * random.random(count)), camera,
                     random.normal(size=(height, width, 3)), random.normal(size=(height, width)), request.param)

    return make
