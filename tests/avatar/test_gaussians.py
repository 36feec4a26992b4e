"""Fresh gaussians on a mesh, and their file."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import artifacts, binding
from gsac.avatar.draw_rule import PIXEL
from gsac.avatar.gaussians import Gaussians


@pytest.fixture
def mesh():
    """Two large triangles, one small one, one without area."""
    vertices = np.array([[0, 0, 2], [1, 0, 2], [0, 1, 2], [1, 1, 2], [1.05, 1, 2], [1, 1.05, 2.02]], np.float32)
    return vertices, np.array([[0, 1, 2], [1, 3, 2], [3, 4, 5], [0, 0, 1]], np.int32)


def placed(mesh, gaussians):
    return binding.bind(binding.face_frames(*mesh), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)


def test_area_placement_lies_on_the_faces_flat_along_the_normal(mesh):
    gaussians = Gaussians.area(*mesh, 400, seed=1)
    vertices, faces = mesh
    assert len(gaussians) == 400 and 3 not in gaussians.face
    bound = placed(mesh, gaussians)
    corners = vertices[faces[gaussians.face]].astype(float)
    inside = np.linalg.solve(corners.transpose(0, 2, 1) + 1e-12, bound.means.astype(float)[:, :, None])[:, :, 0]
    assert np.allclose(inside.sum(1), 1, atol=1e-3) and inside.min() > -1e-3
    normal = np.cross(corners[:, 2] - corners[:, 1], corners[:, 0] - corners[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.allclose(bound.rotations[:, :, 1], normal, atol=1e-5)
    assert (bound.scales[:, 1] < 0.2 * bound.scales[:, 0]).all()


def test_area_placement_draws_faces_by_area_to_the_power(mesh):
    counts = np.bincount(Gaussians.area(*mesh, 5000, seed=2).face, minlength=4)
    areas = np.array([0.5, 0.5, 0.5 * 0.05 * np.hypot(0.05, 0.02), 0])
    expected = 5000 * areas**0.85 / (areas**0.85).sum()
    assert np.abs(counts - expected).max() <= 1


def test_area_placement_covers_the_surface_evenly(mesh):
    """The area that the gaussians stand for is the face's, and no gap is left between them."""
    gaussians = Gaussians.area(*mesh, 1000, seed=3)
    width = placed(mesh, gaussians).scales[:, 0]
    on_first = gaussians.face == 0
    assert np.isclose((width[on_first] ** 2).sum() / 0.55**2, 0.5, rtol=0.01)
    points = placed(mesh, gaussians).means[on_first, :2]
    inside = np.random.default_rng(0).dirichlet((1, 1, 1), 500) @ mesh[0][mesh[1][0], :2]
    gap = np.linalg.norm(inside[:, None] - points, axis=2).min(1)
    assert gap.max() < 3.0 * np.sqrt(0.5 / on_first.sum())


def test_the_same_seed_gives_the_same_gaussians(mesh):
    assert np.array_equal(Gaussians.area(*mesh, 50, seed=4).mu, Gaussians.area(*mesh, 50, seed=4).mu)
    assert not np.array_equal(Gaussians.area(*mesh, 50, seed=4).mu, Gaussians.area(*mesh, 50, seed=5).mu)


def test_the_file_gives_back_what_was_written(mesh, tmp_path):
    gaussians = Gaussians.area(*mesh, 30)
    gaussians.write(tmp_path / "avatar.npz")
    artifacts.check_avatar(tmp_path / "avatar.npz")
    again = Gaussians.read(tmp_path / "avatar.npz")
    for name in artifacts.AVATAR_SHAPES:
        assert np.array_equal(getattr(again, name), getattr(gaussians, name))
    assert again.face.dtype == np.int32
    assert len(again[again.face == 0]) == (gaussians.face == 0).sum()


def test_a_file_without_an_array_is_refused_by_name(mesh, tmp_path):
    artifacts.write_arrays(tmp_path / "avatar.npz", face=np.zeros(3, np.int32))
    with pytest.raises(artifacts.ArtifactError, match="mu"):
        Gaussians.read(tmp_path / "avatar.npz")


def levels_of(mesh):
    return [Gaussians.area(*mesh, count, seed=count) for count in (30, 10, 4)]


def test_coarser_levels_come_back_in_order_and_readers_that_know_none_read_the_finest(mesh, tmp_path):
    finest, *coarser = levels_of(mesh)
    finest.light = np.ones((4, 3), np.float32)
    coarser[0].max_height_px, coarser[1].max_height_px = 270, 135
    finest.write(tmp_path / "avatar.npz", coarser)
    again = Gaussians.read_levels(tmp_path / "avatar.npz")
    assert {level.low_pass for level in again} == {PIXEL}
    assert [len(level) for level in again] == [30, 10, 4] and [level.max_height_px for level in again] == [None, 270, 135]
    for level, wanted in zip(again, (finest, *coarser), strict=True):
        for name in artifacts.AVATAR_SHAPES:
            np.testing.assert_array_equal(getattr(level, name), getattr(wanted, name))
        assert level.face.dtype == np.int32 and level.light.shape == (4, 3)
    with np.load(tmp_path / "avatar.npz") as old:
        np.testing.assert_array_equal(old["mu"], finest.mu)
    np.testing.assert_array_equal(Gaussians.read(tmp_path / "avatar.npz").mu, finest.mu)
    finest.write(tmp_path / "alone.npz")
    assert len(Gaussians.read_levels(tmp_path / "alone.npz")) == 1


@pytest.mark.parametrize(("name", "value", "words"), [
    ("levels", np.int32([10, 5]), "levels"), ("levels", np.int32([4, 10]), "levels"), ("levels", np.int32([14, 0]), "levels"),
    ("level_heights", np.float32([270]), "level_heights"), ("level_heights", np.float32([270, 0]), "level_heights"),
    ("coarser_mu", np.zeros((3, 3), np.float32), "coarser_mu"), ("coarser_rgb", np.full((14, 3), np.nan, np.float32), "finite")])
def test_levels_that_do_not_belong_together_are_refused_by_name(mesh, tmp_path, name, value, words):
    finest, *coarser = levels_of(mesh)
    finest.write(tmp_path / "avatar.npz", coarser)
    arrays = artifacts.read_arrays(tmp_path / "avatar.npz")
    artifacts.write_arrays(tmp_path / "avatar.npz", **(arrays | {name: value}))
    with pytest.raises(artifacts.ArtifactError, match=words):
        Gaussians.read_levels(tmp_path / "avatar.npz")
