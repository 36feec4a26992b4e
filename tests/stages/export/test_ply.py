"""The PLY is read back by independent readers; the figure's left hand is red."""

import io

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.camera import Camera
from gsac.avatar.raster import render
from gsac.stages.export.ply import SH0, ply_bytes
from gsac.stages.export.stage import pose_gaussians

FLIP = np.array([1, -1, -1])


@pytest.fixture(scope="module")
def posed(figure):
    return pose_gaussians(figure, figure.pose("A"))


@pytest.fixture(scope="module")
def ply(figure, posed):
    return ply_bytes(*posed, figure.gaussians.rgb, figure.gaussians.opacity)


@pytest.fixture(scope="module")
def table(ply):
    plyfile = pytest.importorskip("plyfile", reason="needs the package plyfile (pip install plyfile)")
    return plyfile.PlyData.read(io.BytesIO(ply))["vertex"].data


def columns(table, *names):
    return np.stack([table[n] for n in names], axis=1).astype(np.float64)


def test_values_are_decoded_as_every_3dgs_reader_does(figure, posed, table):
    means, quats, scales = posed
    np.testing.assert_allclose(columns(table, "x", "y", "z"), means * FLIP, atol=1e-6)
    np.testing.assert_allclose(np.exp(columns(table, "scale_0", "scale_1", "scale_2")), scales, rtol=1e-5)
    opacity = 1 / (1 + np.exp(-table["opacity"].astype(float)))
    np.testing.assert_allclose(opacity, figure.gaussians.opacity, atol=1e-5)
    rgb = 0.5 + SH0 * columns(table, "f_dc_0", "f_dc_1", "f_dc_2")
    np.testing.assert_allclose(rgb, figure.gaussians.rgb, atol=1e-6)


def test_covariances_turn_with_the_axes(posed, table):
    _, quats, scales = posed
    R = Rotation.from_quat(quats[:, [1, 2, 3, 0]]).as_matrix() * scales[:, None]
    expected = np.diag(FLIP) @ (R @ R.transpose(0, 2, 1)) @ np.diag(FLIP)
    wxyz = columns(table, "rot_0", "rot_1", "rot_2", "rot_3")
    stds = np.exp(columns(table, "scale_0", "scale_1", "scale_2"))
    S = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]]).as_matrix() * stds[:, None]
    np.testing.assert_allclose(S @ S.transpose(0, 2, 1), expected, atol=1e-9)


def test_feet_are_on_the_ground_and_the_person_stands_upright_facing_the_camera(figure, table):
    xyz, name = columns(table, "x", "y", "z"), np.array(figure.joint_names)
    assert abs(xyz[:, 1].max()) < 0.03, "y points down, so the feet have the largest y"
    head = figure.joints[name == "head"][0, 1] - figure.ground
    assert xyz[:, 1].min() < -head
    toes = xyz[xyz[:, 1] > -0.05]
    assert toes[:, 2].min() < -0.1, "z points away from the camera, so toes have negative z"


def test_left_hand_is_on_the_left(table):
    red = (table["f_dc_0"] > 1) & (table["f_dc_1"] < -1)
    blue = (table["f_dc_2"] > 1) & (table["f_dc_0"] < -1)
    assert red.any() and blue.any()
    assert table["x"][red].min() > 0.2, "a person who faces the camera has the left hand at the picture's right, +x"
    assert table["x"][blue].max() < -0.2


def test_an_independent_reader_gives_the_same_picture(tmp_path, figure, posed, ply):
    gsply = pytest.importorskip("gsply", reason="needs the package gsply (pip install gsply)")
    path = tmp_path / "avatar.ply"
    path.write_bytes(ply)
    data = gsply.plyread(str(path))
    camera = Camera((300.0, 300.0), (100.0, 150.0), 200, 300)
    place = np.float32([0, 0.9, 3])
    rotations = Rotation.from_quat(data.quats[:, [1, 2, 3, 0]]).as_matrix().astype(np.float32)
    read = render(data.means + place, rotations, np.exp(data.scales), 0.5 + SH0 * data.sh0,
                  1 / (1 + np.exp(-np.ravel(data.opacities))), camera)
    read = np.concatenate([read.rgb, read.alpha[..., None]], axis=2).copy()
    means, quats, scales = posed
    turned = np.diag(FLIP) @ Rotation.from_quat(quats[:, [1, 2, 3, 0]]).as_matrix()
    direct = render((means * FLIP + place).astype(np.float32), turned.astype(np.float32), scales,
                    figure.gaussians.rgb, figure.gaussians.opacity, camera)
    direct = np.concatenate([direct.rgb, direct.alpha[..., None]], axis=2)
    assert direct[..., 3].max() > 0.9
    assert np.abs(read - direct).max() < 2e-3


def test_padding_adds_45_zeros_and_248_bytes_a_gaussian(figure, posed, ply):
    padded = ply_bytes(*posed, figure.gaussians.rgb, figure.gaussians.opacity, pad_sh=True)
    body = padded.split(b"end_header\n", 1)[1]
    assert len(body) == 248 * len(figure.gaussians)
    rows = np.frombuffer(body, "<f4").reshape(-1, 62)
    assert not rows[:, 9:54].any()
    plain = np.frombuffer(ply.split(b"end_header\n", 1)[1], "<f4").reshape(-1, 17)
    np.testing.assert_array_equal(np.delete(rows, np.s_[9:54], axis=1), plain)


def test_full_and_no_opacity_stay_finite(figure, posed):
    opacity = np.where(np.arange(len(figure.gaussians)) % 2, 0, 1).astype(np.float32)
    rows = np.frombuffer(ply_bytes(*posed, figure.gaussians.rgb, opacity).split(b"end_header\n", 1)[1], "<f4")
    assert np.isfinite(rows).all()
