"""The CUDA kernels' formulas, compiled by the host's C++ compiler, against the CPU path in float64."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from gsac.avatar import binding, light, skinning
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import ADDED, BRIGHTEST, DARKEST, PIXEL, cuda_constants
from gsac.avatar.raster import render, render_backward
from gsac.benchmarks.gpu.published import formulas as haha
from gsac.stages.train.gaussians import kernels
from gsac.stages.train.paper.densify import LARGEST
from gsac.stages.train.paper.knn import K, posed_quats, through_quats
from gsac.stages.train.paper.losses import window_begin

HERE = Path(__file__).parent
SOURCES = Path(binding.__file__).parent / "cuda"
CAMERA = Camera((90.0, 84.0), (15.3, 11.8), 33, 21)


def lens(low_pass):
    return np.array([*CAMERA.focal, *CAMERA.center, CAMERA.width, CAMERA.height, *low_pass])


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    compiler = shutil.which("g++") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc here: the kernels' formulas are not compiled for the host")
    library = tmp_path_factory.mktemp("formulas") / "formulas.so"
    constants = library.with_name("constants.h")
    constants.write_text(cuda_constants())
    subprocess.run([compiler, "-std=c++17", "-O1", "-shared", "-fPIC", "-I", str(SOURCES), "-include", str(constants),
                    "-o", str(library), "-x", "c++", str(HERE / "formulas_host.cpp"), "-lstdc++", "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))

    def call(name, *arguments):
        plain = [a.ctypes.data_as(ctypes.c_void_p) if isinstance(a, np.ndarray) else
                 ctypes.c_double(a) if isinstance(a, float) else a for a in arguments]
        function = getattr(loaded, name)
        function.restype = ctypes.c_double
        return function(*plain)
    return call


def gaussians(rng, count):
    """Free gaussians, some behind the camera, some at the frustum's rim, some not seen at all."""
    means = rng.normal(0, [0.5, 0.4, 0.5], (count, 3)) + [0, 0, 2]
    means[:3] = [[0, 0, -1], [9, 0, 2], [0.9, 0, 1.2]]
    rotations = skinning.rotation_matrices(rng.normal(size=(count, 3)))
    scales = np.exp(rng.normal(-2.5, 0.5, (count, 3)))
    opacity = rng.uniform(0.05, 0.95, count)
    opacity[3] = 0
    opacity[4:7] = 1
    return means, rotations, scales, rng.random((count, 3)), opacity


@pytest.mark.parametrize("degenerate", [False, True])
def test_binding_and_its_gradient_are_those_of_the_cpu_path(host, degenerate):
    rng = np.random.default_rng(1)
    n = 40
    vertices, faces = rng.normal(size=(3 * n, 3)), np.arange(3 * n, dtype=np.int32).reshape(n, 3)
    mu, quat, log_scale = rng.normal(size=(n, 3)), rng.normal(size=(n, 4)), rng.normal(-1, 0.3, (n, 3))
    if degenerate:
        vertices[2] = vertices[1]
        quat[1] = 0
    face = np.arange(n, dtype=np.int32)
    grads = rng.normal(size=(n, 3)), rng.normal(size=(n, 3, 3)), rng.normal(size=(n, 3))
    expected = binding.bind(binding.face_frames(vertices, faces), face, mu, quat, log_scale)
    back = binding.bind_backward(vertices, faces, face, mu, quat, log_scale, *grads)
    out = [np.full(s, np.nan) for s in ((n, 3), (n, 3, 3), (n, 3))]
    got = [np.full(s, np.nan) for s in ((n, 3), (n, 4), (n, 3), (3 * n, 3))]
    host("bind_all", n, vertices[faces].copy(), mu, quat, log_scale, *out, *grads, *got)
    for name, a, b in zip(("means", "rotations", "scales", *back._fields), (*out, *got), (*expected, *back), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11, err_msg=name)


def test_the_light_on_a_face_is_that_of_the_cpu_path(host):
    rng = np.random.default_rng(9)
    normals, lamps, got = rng.normal(size=(60, 3)), rng.normal([[1], [0], [0], [0]], 0.6, (4, 3)), np.full((60, 3), np.nan)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    host("shade_all", 60, lamps, normals, got)
    expected = light.shade(lamps, normals * light.FROM_CAMERA)
    assert (expected == DARKEST).any() and (expected == BRIGHTEST).any()
    np.testing.assert_allclose(got, expected, rtol=1e-12)


@pytest.mark.parametrize("low_pass", [ADDED, PIXEL], ids=["added", "pixel"])
def test_projection_compositing_and_their_gradients_are_those_of_the_cpu_path(host, low_pass):
    rng = np.random.default_rng(2)
    scene = gaussians(rng, 30)
    rendering = render(*scene, CAMERA, low_pass=low_pass)
    grad = rng.normal(size=(CAMERA.height, CAMERA.width, 4))
    expected = render_backward(rendering.state, grad[..., :3].copy(), grad[..., 3].copy())
    order = np.argsort(scene[0][:, 2], kind="stable")
    sorted_scene = [np.ascontiguousarray(a[order]) for a in scene]
    image = np.full(grad.shape, np.nan)
    got = [np.full(s, np.nan) for s in ((30, 3), (30, 3, 3), (30, 3), (30, 3), (30,))]
    with np.errstate(all="ignore"):
        host("render_all", 30, lens(low_pass), *sorted_scene, grad, image, *got)
    assert np.abs(image - np.dstack([rendering.rgb, rendering.alpha])).max() < 2e-6  # the CPU's exp is a polynomial
    for name, a, b in zip(expected._fields, got, expected, strict=True):
        b = b[order]
        a = np.where(np.isfinite(a), a, 0)  # 0 / 0 of the opacity that is zero
        assert np.linalg.norm(a - b) < 3e-6 * np.linalg.norm(b), name
        assert np.linalg.norm(b) > 0


def test_rotation_vectors_and_their_gradient_are_those_of_the_cpu_path(host):
    rng = np.random.default_rng(3)
    pose = np.concatenate([rng.normal(size=(20, 3)), rng.normal(size=(20, 3)) * 1e-3, np.zeros((1, 3))])
    n = len(pose)
    grad, out, got = rng.normal(size=(n, 3, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
    host("turn_all", n, pose, out, grad, got)
    expected = np.empty_like(pose)
    skinning._rodrigues_backward(pose, grad, expected)
    np.testing.assert_allclose(out, skinning.rotation_matrices(pose), rtol=0, atol=1e-14)
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-13)


def test_adam_and_limits_are_those_of_the_cpu_path(host):
    rng = np.random.default_rng(4)
    n = 50
    value, grad = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    grad[::5] = 0
    first, second, count = rng.normal(size=(n, 3)), rng.random((n, 3)), rng.integers(1, 900, n)
    ours, theirs = [value.copy(), first.copy(), second.copy()], [value.copy(), first.copy(), second.copy()]
    host("adam_all", n, 3, ours[0], grad, ours[1], ours[2], count, 1e-2)
    bias = np.empty((n, 2))
    kernels.count_rows(np.zeros_like(grad), count, bias)
    kernels.adam_rows(theirs[0], grad, theirs[1], theirs[2], bias, 1e-2)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    values = [rng.normal(size=(n, 3)), rng.normal(size=(n, 4)), rng.normal(-3, 2, (n, 3)), rng.normal(size=(n, 3)),
              rng.normal(0, 9, (n, 1))]
    values[1][0] = 0
    start, face_scale = rng.normal(size=(n, 3)), rng.uniform(0, 0.2, n)
    largest, tied = rng.uniform(0.01, 0.05, n), rng.integers(0, 2, n, np.int32)
    ours, theirs = [v.copy() for v in values], [v.copy() for v in values]
    host("limit_all", n, *ours, start, face_scale, largest, tied, 4.0, 0.004, 0.08, 0.003, 1e-3)
    kernels.limit(*theirs, start, face_scale, largest, tied > 0, 4.0, 0.004, 0.08, 0.003, 1e-3)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)


def test_scales_of_recipe_paper_and_their_slope_are_those_of_the_cpu_path(host):
    logit = np.random.default_rng(5).normal(-2, 3, 60)
    got, slope = np.empty(60), np.empty(60)
    host("scale_all", 60, logit, LARGEST, got, slope)
    np.testing.assert_allclose(got, np.log(LARGEST) - np.log1p(np.exp(-logit)), rtol=1e-12)
    np.testing.assert_allclose(slope, 1 / (1 + np.exp(logit)), rtol=1e-12)


def test_likeness_of_neighbours_is_the_published_one(host):
    rng = np.random.default_rng(6)
    values = rng.normal(size=(40, 4))
    index = np.stack([np.arange(40), *rng.permuted(np.tile(np.arange(40), (2, 1)), axis=1)], 1)
    values[index[7]] = values[7]  # no deviation, no slope
    got, leaf = np.zeros_like(values), torch.tensor(values, requires_grad=True)
    value = host("spread_all", 40, 4, values, np.ascontiguousarray(index, np.int64), 0.3 / values.size, got)
    expected = 0.3 * leaf[torch.tensor(index)].std(dim=1).mean()
    expected.backward()
    assert index.shape == (40, K) and value == pytest.approx(expected.item(), rel=1e-10)
    np.testing.assert_allclose(got, leaf.grad, rtol=1e-9, atol=1e-15)


def test_quaternions_of_posed_gaussians_and_their_gradient_are_the_published_ones(host):
    """A turn by h about an axis changes the sum of quaternions times weights by h times the sum of gradients times moves."""
    rng = np.random.default_rng(11)
    rotations, grad = Rotation.random(60, random_state=1).as_matrix(), rng.normal(size=(60, 4))
    quats, out = np.empty((60, 4)), np.empty((60, 3, 3))
    host("quat_all", 60, rotations, grad, quats, out)
    published = haha.multiply(haha.quaternion(torch.tensor(rotations)), torch.tensor([[1.0, 0, 0, 0]] * 60, dtype=torch.float64))
    np.testing.assert_allclose(quats, published, atol=1e-12)
    np.testing.assert_allclose(quats, posed_quats(rotations), atol=1e-12)
    np.testing.assert_allclose(out, through_quats(quats, grad, rotations), atol=1e-12)
    for axis in np.eye(3):
        turned = [Rotation.from_rotvec(h * axis).as_matrix() @ rotations for h in (1e-5, -1e-5)]
        measured = ((posed_quats(turned[0]) - posed_quats(turned[1])) * grad).sum(1) / 2e-5
        moves = np.cross(axis, rotations, axisb=1, axisc=1)
        np.testing.assert_allclose((out * moves).sum((1, 2)), measured, atol=1e-7)


def test_edges_and_dice_of_recipe_paper_are_the_published_ones(host):
    rng = np.random.default_rng(7)
    image, target = rng.random((12, 12, 3)), rng.random((12, 12, 3))
    image[:5, :4] = target[:5, :4]  # equal strengths have no slope
    got, leaf = np.zeros_like(image), torch.tensor(image[None], requires_grad=True)
    loss = host("edges_all", 12, 12, image, target, 0.7 / 144, got)
    expected = 0.7 * torch.nn.functional.l1_loss(haha.strength(leaf), haha.strength(torch.tensor(target[None])))
    expected.backward()
    assert loss == pytest.approx(expected.item(), rel=1e-10)
    np.testing.assert_allclose(got, leaf.grad[0], rtol=1e-9, atol=1e-15)
    pixels, alpha, got = rng.integers(0, 256, (12, 9, 4), dtype=np.uint8), rng.random((12, 9)), np.empty((12, 9))
    whole = [torch.nn.functional.pad(torch.tensor(part), (0, 5)) for part in (alpha, pixels[..., 3] / 255)]
    whole[0].requires_grad_()
    loss = host("dice_all", 108, alpha, pixels[..., 3] / 255, 60.0, 0.1, got)
    expected = 0.1 * haha.dice(*whole)
    expected.backward()
    assert loss == pytest.approx(expected.item(), rel=1e-10)
    np.testing.assert_allclose(got, whole[0].grad[:, :9], rtol=1e-9)


def test_adam_of_recipe_paper_is_that_of_the_cpu_path(host):
    rng = np.random.default_rng(8)
    arrays = [rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), rng.random((30, 3))]
    ours, theirs = [a.copy() for a in arrays], [a.copy() for a in arrays]
    host("adam_dense", 90, *ours, 9, 5e-3)
    kernels.adam(*theirs, 9, 5e-3)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_the_windows_that_lpips_sees_lie_inside_and_those_of_recipe_paper_are_the_published_ones(host):
    centres = np.random.default_rng(3).uniform(-100, 700, 60)
    for side in (257, 411, 500):
        got, own = np.full(60, -1, np.int32), np.full(60, -1, np.int32)
        host("square_window_all", 60, centres, 256, side, got)
        assert got.tolist() == [haha.window(centre, side) for centre in centres] == [window_begin(c, side) for c in centres]
        host("window_all", 60, centres, 256, side, own)
        np.testing.assert_array_equal(own, np.floor(np.clip(centres - 128, 0, side - 256)))
    for side in (100, 256):
        host("square_window_all", 60, centres, side, side, got)
        assert not got.any()


def test_a_step_of_the_joints_at_rest_is_that_of_the_cpu_path(host):
    from gsac.avatar.body import Body, BodyParams
    from gsac.stages.train.poses.poses import JOINT, Poses

    body, rng = Body.load(), np.random.default_rng(8)
    poses = Poses(body, BodyParams.from_pose(np.zeros((1, 55, 3)), np.zeros((1, 3)), np.zeros(4),
                                             np.zeros((1, body.exprdirs.shape[2])), 500.0, (0, 0)))
    poses.joint_share[:] = 1
    value, first, second = np.zeros((55, 3)), np.zeros((55, 3)), np.zeros((55, 3))
    for step in range(1, 5):
        grad = rng.normal(size=(55, 3)) * 1e-3
        poses.step_joints(grad, 2e-3, 1e-4)
        host("adam_pulled_all", 165, value, grad, first, second, step, 2e-3, 1e-4, JOINT)
    assert np.abs(value).max() > 1e-3
    np.testing.assert_allclose(value, poses.joint_offset, rtol=1e-12)
