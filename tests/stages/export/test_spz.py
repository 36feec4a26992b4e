"""avatar.spz read back by two independent readers, gsply and splat-transform; the figure's left hand is red."""

import io
import subprocess

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gsac.stages.export.ply import SH0, ply_bytes
from gsac.stages.export.spz import pack_smallest_three, spz_bytes
from gsac.stages.export.stage import pose_gaussians

SPLAT_TRANSFORM = "@playcanvas/splat-transform@2.7.1"


@pytest.fixture(scope="module")
def posed(figure):
    return pose_gaussians(figure, figure.pose("A"))


@pytest.fixture(scope="module")
def spz(figure, posed):
    return spz_bytes(*posed, figure.gaussians.rgb, figure.gaussians.opacity)


@pytest.fixture(scope="module")
def read(spz, tmp_path_factory):
    gsply = pytest.importorskip("gsply", reason="needs the package gsply (pip install gsply)")
    path = tmp_path_factory.mktemp("spz") / "avatar.spz"
    path.write_bytes(spz)
    return gsply.read_spz(path)


def covariance(quats, scales):
    R = Rotation.from_quat(quats[:, [1, 2, 3, 0]]).as_matrix() * scales[:, None]
    return R @ R.transpose(0, 2, 1)


@pytest.mark.slow
def test_every_value_comes_back_within_a_step(figure, posed, read):
    means, quats, scales = posed
    np.testing.assert_allclose(read.means, means, atol=2 ** -16)
    np.testing.assert_allclose(read.scales, np.log(scales), atol=1 / 31)
    np.testing.assert_allclose(1 / (1 + np.exp(-np.ravel(read.opacities))), figure.gaussians.opacity, atol=1 / 500)
    np.testing.assert_allclose(0.5 + SH0 * np.squeeze(read.sh0), figure.gaussians.rgb, atol=SH0 / 0.15 / 500)
    turned = Rotation.from_quat(read.quats[:, [1, 2, 3, 0]]).inv() * Rotation.from_quat(quats[:, [1, 2, 3, 0]])
    assert np.degrees(turned.magnitude()).max() < 0.3


@pytest.mark.slow
def test_the_left_hand_is_on_the_left_upright_and_facing_us(figure, read):
    red = (figure.gaussians.rgb[:, 0] > .7)
    assert read.means[red, 0].min() > 0.2 and read.means[:, 1].max() > 1.4
    toes = read.means[read.means[:, 1] < 0.05]
    assert toes[:, 2].max() > 0.1 > -toes[:, 2].min()


@pytest.mark.parametrize("wxyz", [
    (1, 0, 0, 0), (0, 1, 0, 0), (-1, 0, 0, 0), (.5, -.5, .5, -.5), (0, 0, -.6, .8), (.1, -.7, .7, -.1)])
def test_a_rotation_keeps_its_sense_whatever_its_largest_part(wxyz):
    word = int(pack_smallest_three(np.array([wxyz], float))[0])
    largest, parts = word >> 30, []
    for shift in (20, 10, 0):
        bits = word >> shift & 1023
        parts.append((-1 if bits >> 9 else 1) * (bits & 511) / 511 / np.sqrt(2))
    xyzw = np.insert(parts, largest, np.sqrt(max(0, 1 - np.square(parts).sum())))
    want = np.array(wxyz)[[1, 2, 3, 0]]
    assert abs(xyzw @ want) / np.linalg.norm(want) > 1 - 1e-5


def test_it_is_small_and_the_same_each_time(figure, posed, spz):
    again = spz_bytes(*posed, figure.gaussians.rgb, figure.gaussians.opacity)
    assert again == spz and len(spz) < 20 * len(posed[0])


def test_no_opacity_no_size_and_no_gaussian_are_files_too(posed):
    means, quats, scales = (x[:4] for x in posed)
    assert spz_bytes(means, quats, scales * 0, np.ones((4, 3)), np.array([0, 1, 0, 1.0]))
    assert spz_bytes(means[:0], quats[:0], scales[:0], np.ones((0, 3)), np.ones(0))


@pytest.mark.slow
def test_splat_transform_sees_the_same_gaussians_as_in_our_ply(figure, posed, spz, node_package):
    plyfile = pytest.importorskip("plyfile", reason="needs the package plyfile (pip install plyfile)")
    folder = node_package(SPLAT_TRANSFORM)
    (folder / "avatar.spz").write_bytes(spz)
    subprocess.run(["node", "node_modules/@playcanvas/splat-transform/bin/cli.mjs", "avatar.spz", "back.ply"], cwd=folder,
                   capture_output=True, check=True)
    ours = ply_bytes(*posed, figure.gaussians.rgb, figure.gaussians.opacity)
    ours, back = (plyfile.PlyData.read(io.BytesIO(raw))["vertex"].data for raw in (ours, (folder / "back.ply").read_bytes()))

    def rows(table, *names):
        return np.stack([table[name] for name in names], 1).astype(float)

    def stack(table):
        return (rows(table, "x", "y", "z"), rows(table, "f_dc_0", "f_dc_1", "f_dc_2"),
                covariance(rows(table, "rot_0", "rot_1", "rot_2", "rot_3"), np.exp(rows(table, "scale_0", "scale_1", "scale_2"))))

    distance, near = cKDTree(stack(back)[0]).query(stack(ours)[0])
    assert len(ours) == len(back) and distance.max() < 1e-4
    assert len(set(near)) == len(ours)
    (_, colour, covariances), (_, other_colour, others) = stack(ours), stack(back)
    np.testing.assert_allclose(other_colour[near], colour, atol=1 / 0.15 / 400)
    assert np.abs(others[near] - covariances).max() < 0.1 * np.abs(covariances).max()
