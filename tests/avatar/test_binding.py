"""The binding against its formula in torch, and its gradient down to the vertices through the rasteriser."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.avatar import binding, raster
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import reference


def torch_bind(vertices, faces, face, mu, quat, log_scale):
    """DESIGN's formula, word by word; faces with an area only."""
    v0, v1, v2 = (vertices[faces[face, i]] for i in range(3))
    cross = torch.linalg.cross(v2 - v1, v0 - v1)
    a = (v2 - v1) / (v2 - v1).norm(dim=1, keepdim=True)
    n = cross / cross.norm(dim=1, keepdim=True)
    R = torch.stack([a, n, torch.linalg.cross(a, n)], 2)
    L = (v0 - v2).norm(dim=1)
    k = 0.5 * (cross.norm(dim=1) / L + L) / 0.05
    w, x, y, z = (quat / quat.norm(dim=1, keepdim=True)).T
    r = torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], 1).reshape(-1, 3, 3)
    means = k[:, None] * (R @ mu[:, :, None])[..., 0] + (v0 + v1 + v2) / 3
    return means, R @ r, k[:, None] * torch.exp(log_scale)


@pytest.fixture
def mesh():
    """A bent sheet of 72 triangles, (V, 3) m and (F, 3), 2 m before the camera."""
    random = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 7), np.linspace(-0.5, 0.5, 7))
    vertices = np.stack([x, y, 2 + 0.2 * np.sin(4 * x)], -1).reshape(-1, 3) + 0.02 * random.normal(size=(49, 3))
    corner = (np.arange(6)[:, None] * 7 + np.arange(6)).reshape(-1)
    faces = np.concatenate([np.stack([corner, corner + 1, corner + 7], 1), np.stack([corner + 1, corner + 8, corner + 7], 1)])
    return vertices, faces.astype(np.int32)


@pytest.fixture
def gaussians():
    random = np.random.default_rng(1)
    return Gaussians(random.integers(0, 72, 90).astype(np.int32), 0.02 * random.normal(size=(90, 3)),
                     random.normal(size=(90, 4)), -4 + 0.3 * random.normal(size=(90, 3)), random.random((90, 3)),
                     0.9 * random.random(90))


def test_frame_of_a_known_face():
    vertices = np.array([[0, 0, 0], [0, 3, 0], [4, 3, 0]], float)
    frames = binding.face_frames(vertices, np.array([[0, 1, 2]]))
    assert np.allclose(frames.R[0], np.stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]], 1))
    assert np.allclose(frames.T[0], [4 / 3, 2, 0])
    assert np.isclose(frames.k[0], 0.5 * (12 / 5 + 5) / 0.05)
    assert frames.valid[0]


def test_frames_are_right_handed_rotations(mesh):
    R = binding.face_frames(*mesh).R
    assert np.allclose(R @ R.transpose(0, 2, 1), np.eye(3)) and np.allclose(np.linalg.det(R), 1)


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_a_face_without_area_has_the_identity_and_scale_zero(real):
    vertices = np.array([[0, 0, 2], [1, 0, 2], [2, 0, 2]], real)
    frames = binding.face_frames(vertices, np.array([[0, 1, 2], [1, 1, 1]]))
    assert not frames.valid.any() and not frames.k.any() and np.array_equal(frames.R, np.tile(np.eye(3), (2, 1, 1)))
    bound = binding.bind(frames, np.array([0, 1]), np.ones((2, 3), real), np.ones((2, 4)), np.zeros((2, 3)))
    assert np.array_equal(bound.means, frames.T) and not bound.scales.any()


def test_binding_follows_the_formula(mesh, gaussians):
    vertices, faces = mesh
    got = binding.bind(binding.face_frames(vertices, faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    wanted = torch_bind(*(torch.tensor(a) for a in (vertices, faces, gaussians.face, gaussians.mu, gaussians.quat,
                                                    gaussians.log_scale)))
    for g, w in zip(got, wanted, strict=True):
        assert np.allclose(g, w.numpy(), rtol=1e-12, atol=1e-14)


def test_gradients_of_the_binding_agree_with_autograd(mesh, gaussians):
    vertices, faces = mesh
    leaves = [torch.tensor(a, requires_grad=True) for a in (vertices, gaussians.mu, gaussians.quat, gaussians.log_scale)]
    bound = torch_bind(leaves[0], torch.tensor(faces), torch.tensor(gaussians.face), *leaves[1:])
    random = np.random.default_rng(2)
    above = [random.normal(size=tuple(b.shape)) for b in bound]
    sum((b * torch.tensor(g)).sum() for b, g in zip(bound, above, strict=True)).backward()
    got = binding.bind_backward(vertices, faces, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale, *above)
    for name, leaf in zip(("vertices", "mu", "quat", "log_scale"), leaves, strict=True):
        wanted = leaf.grad.numpy()
        assert np.abs(getattr(got, name) - wanted).max() < 1e-11 * np.abs(wanted).max(), name


@pytest.mark.parametrize(("real", "bound"), [(np.float64, 1e-9), (np.float32, 2e-4)])
def test_image_gradient_reaches_gaussians_and_vertices(mesh, gaussians, real, bound):
    """Rendered through the binding, against torch autograd through the brute-force reference; an odd size."""
    vertices, faces = mesh
    camera = Camera((60, 62), (25, 18), 51, 37)
    names = ("mu", "quat", "log_scale", "rgb", "opacity")
    leaves = {n: torch.tensor(getattr(gaussians, n), requires_grad=True) for n in names}
    v = torch.tensor(vertices, requires_grad=True)
    placed = torch_bind(v, torch.tensor(faces), torch.tensor(gaussians.face), leaves["mu"], leaves["quat"], leaves["log_scale"])
    rgb, alpha = reference.render(*placed, leaves["rgb"], leaves["opacity"], camera)
    random = np.random.default_rng(3)
    grad_rgb, grad_alpha = random.normal(size=rgb.shape), random.normal(size=alpha.shape)
    ((rgb * torch.tensor(grad_rgb)).sum() + (alpha * torch.tensor(grad_alpha)).sum()).backward()

    ours = Gaussians(gaussians.face, *(getattr(gaussians, n).astype(real) for n in names))
    rendering = raster.render_bound(vertices.astype(real), faces, ours, camera)
    assert np.abs(rendering.rgb - rgb.detach().numpy()).max() < bound
    got = raster.render_bound_backward(rendering.state, grad_rgb.astype(real), grad_alpha.astype(real))
    for name, leaf in [*leaves.items(), ("vertices", v)]:
        wanted = leaf.grad.numpy()
        assert np.abs(getattr(got, name) - wanted).max() < bound * np.abs(wanted).max(), name
