"""avatar.sog by PlayCanvas' description of the format, and read back by splat-transform as the PLY that it stands for."""

import io
import json
import subprocess
import zipfile

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.ply import ply_bytes
from gsac.stages.export.sog import choose_table, sog_bytes
from gsac.stages.export.stage import pose_gaussians

SPLAT_TRANSFORM = "@playcanvas/splat-transform@2.7.1"


@pytest.fixture(scope="module")
def splats(exported):
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    return *pose_gaussians(avatar, avatar.pose("A")), avatar.gaussians.rgb, avatar.gaussians.opacity


@pytest.fixture(scope="module")
def sog(splats):
    return sog_bytes(*splats)


def test_it_holds_what_its_head_says_as_pictures_without_loss(splats, sog):
    with zipfile.ZipFile(io.BytesIO(sog)) as archive:
        meta = json.loads(archive.read("meta.json"))
        named = [name for part in ("means", "scales", "quats", "sh0") for name in meta[part]["files"]]
        assert set(archive.namelist()) == {"meta.json", *named}
        pictures = {name: np.asarray(Image.open(io.BytesIO(archive.read(name)))) for name in named}
    assert meta["version"] == 2 and meta["count"] == len(splats[0])
    assert len(meta["scales"]["codebook"]) == len(meta["sh0"]["codebook"]) == 256
    assert len({p.shape for p in pictures.values()}) == 1 and pictures["quats.webp"].shape[2] == 4
    rows = {name: p.reshape(-1, 4)[:meta["count"]] for name, p in pictures.items()}
    assert rows["quats.webp"][:, 3].min() >= 252
    fixed = rows["means_l.webp"][:, :3] + 256 * rows["means_u.webp"][:, :3].astype(int)
    low, high = np.array(meta["means"]["mins"]), np.array(meta["means"]["maxs"])
    places = low + fixed / 65535 * (high - low)
    places = np.sign(places) * np.expm1(np.abs(places)) * (1, -1, -1)
    assert cKDTree(places).query(splats[0])[0].max() < 1e-4
    assert len(sog) < 0.3 * len(ply_bytes(*splats))


def test_a_table_of_256_is_near_every_value():
    values = np.random.default_rng(0).normal(size=(4000, 3))
    table, index = choose_table(values)
    assert (np.diff(table) >= 0).all() and index.min() >= 0 and index.max() <= 255
    error = np.abs(table[index] - values)
    np.testing.assert_allclose(error, np.abs(values[..., None] - table).min(-1), atol=1e-12)
    assert error.mean() < 0.007
    few, index = choose_table(np.tile([[1.0, 2.0, 2.0]], (5, 1)))
    np.testing.assert_allclose(few[index], np.tile([[1.0, 2.0, 2.0]], (5, 1)), atol=1e-12)


def test_same_input_same_bytes_and_one_gaussian_is_a_file_too(splats, sog):
    assert sog_bytes(*splats) == sog
    assert zipfile.ZipFile(io.BytesIO(sog_bytes(*(x[:1] for x in splats)))).testzip() is None


@pytest.mark.slow
def test_splat_transform_reads_back_the_gaussians_of_the_ply(splats, sog, node_package):
    plyfile = pytest.importorskip("plyfile", reason="needs the package plyfile (pip install plyfile)")
    folder = node_package(SPLAT_TRANSFORM)
    (folder / "avatar.sog").write_bytes(sog)
    done = subprocess.run(["node", "node_modules/.bin/splat-transform", "avatar.sog", "-w", "sog.ply"], cwd=folder,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    got, want = (plyfile.PlyData.read(io.BytesIO(raw))["vertex"].data
                 for raw in ((folder / "sog.ply").read_bytes(), ply_bytes(*splats)))

    def columns(table, *names):
        return np.stack([table[name] for name in names], 1).astype(float)

    def covariances(table):
        turn = Rotation.from_quat(columns(table, "rot_1", "rot_2", "rot_3", "rot_0")).as_matrix()
        turn = turn * np.exp(columns(table, "scale_0", "scale_1", "scale_2"))[:, None]
        return turn @ turn.transpose(0, 2, 1)

    distance, match = cKDTree(columns(got, "x", "y", "z")).query(columns(want, "x", "y", "z"))
    assert len(got) == len(want) and distance.max() < 1e-4
    got = got[match]
    assert np.abs(got["opacity"] - want["opacity"])[np.abs(want["opacity"]) < 3].max() < 0.06
    for name in ("f_dc_0", "f_dc_1", "f_dc_2"):
        assert np.abs(got[name] - want[name]).mean() < 0.01
    a, b = covariances(got), covariances(want)
    error = np.linalg.norm(a - b, axis=(1, 2)) / np.linalg.norm(b, axis=(1, 2))
    assert np.median(error) < 0.03 and np.quantile(error, 0.99) < 0.2
