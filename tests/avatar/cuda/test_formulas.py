"""The CUDA kernels' formulas, compiled by the host's C++ compiler, against the CPU path in float64."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from gsac.avatar import binding, skinning
from gsac.avatar.camera import Camera
from gsac.avatar.raster import render, render_backward
from gsac.stages.train import kernels

HERE = Path(__file__).parent
SOURCES = Path(binding.__file__).parent / "cuda"
CAMERA = Camera((90.0, 84.0), (15.3, 11.8), 33, 21)
LENS = np.array([*CAMERA.focal, *CAMERA.center, CAMERA.width, CAMERA.height])


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    compiler = shutil.which("g++") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc here: the kernels' formulas are not compiled for the host")
    library = tmp_path_factory.mktemp("formulas") / "formulas.so"
    subprocess.run([compiler, "-std=c++17", "-O1", "-shared", "-fPIC", "-I", str(SOURCES), "-o", str(library), "-x", "c++",
                    str(HERE / "formulas_host.cpp"), "-lstdc++", "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))

    def call(name, *arguments):
        plain = [a.ctypes.data_as(ctypes.c_void_p) if isinstance(a, np.ndarray) else
                 ctypes.c_double(a) if isinstance(a, float) else a for a in arguments]
        getattr(loaded, name)(*plain)
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


def test_projection_compositing_and_their_gradients_are_those_of_the_cpu_path(host):
    rng = np.random.default_rng(2)
    scene = gaussians(rng, 30)
    rendering = render(*scene, CAMERA)
    grad = rng.normal(size=(CAMERA.height, CAMERA.width, 4))
    expected = render_backward(rendering.state, grad[..., :3].copy(), grad[..., 3].copy())
    order = np.argsort(scene[0][:, 2], kind="stable")
    sorted_scene = [np.ascontiguousarray(a[order]) for a in scene]
    image = np.full(grad.shape, np.nan)
    got = [np.full(s, np.nan) for s in ((30, 3), (30, 3, 3), (30, 3), (30, 3), (30,))]
    with np.errstate(all="ignore"):
        host("render_all", 30, LENS, *sorted_scene, grad, image, *got)
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
    kernels.adam_rows(theirs[0], grad, theirs[1], theirs[2], count, 1e-2)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    values = [rng.normal(size=(n, 3)), rng.normal(size=(n, 4)), rng.normal(-3, 2, (n, 3)), rng.normal(size=(n, 3)),
              rng.normal(0, 9, (n, 1))]
    values[1][0] = 0
    start, face_scale = rng.normal(size=(n, 3)), rng.uniform(0, 0.2, n)
    ours, theirs = [v.copy() for v in values], [v.copy() for v in values]
    host("limit_all", n, *ours, start, face_scale, 4.0, 0.05, 0.08, 1e-3)
    kernels.limit(*theirs, start, face_scale, 4.0, 0.05, 0.08, 1e-3)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)
