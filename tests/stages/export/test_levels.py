"""Coarser levels of detail: fewer gaussians, nearly the same picture from afar, in any pose."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import FIELDS, Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.light import shade
from gsac.avatar.raster import render
from gsac.stages.contract import BadInput, Job
from gsac.stages.export.config import ExportConfig
from gsac.stages.export.levels import MEMBERS, merge_level
from gsac.stages.export.stage import run

TALL = 120
"""px: a person of 1.7 m at 14 m on a screen of 1080 lines with 60 degrees."""

EVEN = np.float32([[1] * 3, [0] * 3, [0] * 3, [0] * 3])


@pytest.fixture(scope="module")
def avatar(exported):
    return RiggedAvatar.read(exported / "avatar.gsac")


def picture(avatar, g, pose, light=EVEN):
    vertices = avatar.posed(avatar.pose(pose))
    frames = face_frames(vertices, avatar.faces)
    rgb = g.rgb * shade(light, frames.R[g.face, :, 1].astype(np.float32))
    bound = bind(frames, g.face, g.mu, g.quat, g.log_scale)
    flip, middle = np.diag([1.0, -1, -1]), (vertices.min(0) + vertices.max(0)) / 2
    focal = TALL / np.ptp(vertices[:, 1]) * 6
    out = render(((bound.means - middle) @ flip.T + (0, 0, 6)).astype(np.float32), (flip @ bound.rotations).astype(np.float32),
                 bound.scales.astype(np.float32), rgb, g.opacity, Camera((focal, focal), (80.0, 80.0), 160, 160))
    return np.concatenate([out.rgb, out.alpha[..., None]], 2)


def error(avatar, g, pose, light=EVEN):
    fine = picture(avatar, avatar.gaussians, pose, light)
    return ((picture(avatar, g, pose, light) - fine)[fine[..., 3] > .02] ** 2).mean()


def test_the_file_carries_a_third_and_a_ninth_of_the_gaussians(avatar):
    N = len(avatar.gaussians)
    for level, members in zip(avatar.coarser, MEMBERS, strict=True):
        assert N / members <= len(level) <= N / members * 1.1


@pytest.mark.parametrize("pose", ["T", "A"])
def test_a_coarser_level_is_nearer_to_the_fine_picture_than_left_out_gaussians_made_larger(avatar, pose):
    for level, members in zip(avatar.coarser, MEMBERS, strict=True):
        fewer = avatar.gaussians[::members]
        fewer.log_scale = fewer.log_scale + .5 * np.log(members).astype(np.float32)
        got, simple = error(avatar, level, pose), error(avatar, fewer, pose)
        print(f"{pose} 1/{members}: {-10 * np.log10(got):.1f} dB, left out {-10 * np.log10(simple):.1f} dB")
        assert got < simple * .7


@pytest.mark.parametrize("pose", ["T", "A"])
def test_a_coarser_level_is_as_near_to_the_fine_picture_in_a_strong_light_as_in_an_even_one(avatar, pose):
    light = np.float32([[.8, .75, .7], [.3, .2, -.1], [.2, .1, .3], [.25, -.6, .2]])
    for level in avatar.coarser:
        got, even = error(avatar, level, pose, light), error(avatar, level, pose)
        print(f"{pose} {len(level)}: lit {-10 * np.log10(got):.1f} dB, even {-10 * np.log10(even):.1f} dB")
        assert got < even * 1.25


def test_merging_one_by_one_changes_nothing(avatar):
    assert error(avatar, merge_level(avatar, 1), "A") < 1e-5


def test_the_left_hand_stays_red(avatar):
    for level in avatar.coarser:
        place = avatar.vertices[avatar.faces[level.face]].mean(1)
        hand = place[:, 0] > avatar.joints[avatar.joint_names.index("left_wrist"), 0] + .05
        assert hand.any() and (level.rgb[hand, 0] > .6).all() and (level.rgb[hand, 1:] < .3).all()


def test_gaussians_on_faces_without_area_and_a_single_gaussian_are_merged_without_nan(figure):
    vertices = figure.vertices.copy()
    vertices[figure.faces[0]] = vertices[figure.faces[0, 0]]
    for g in (figure.gaussians, figure.gaussians[:1]):
        level = merge_level(replace(figure, vertices=vertices, gaussians=g), 3)
        assert len(level) >= 1
        assert all(np.isfinite(getattr(level, name)).all() for name in FIELDS)
        np.testing.assert_allclose((level.quat ** 2).sum(1), 1, atol=1e-5)


def test_levels_that_were_trained_are_carried_on_as_they_are(person, tmp_path):
    finest = Gaussians.read(person["train/avatar.npz"])
    finest.write(tmp_path / "avatar.npz", [replace(finest[::step], max_height_px=height) for step, height in ((4, 230), (16, 115))])
    (tmp_path / "out").mkdir()
    run(Job(person | {"train/avatar.npz": tmp_path / "avatar.npz"}, tmp_path / "out", ExportConfig(animations="")))
    levels = RiggedAvatar.read(tmp_path / "out" / "avatar.gsac").coarser
    assert [(len(level), level.max_height_px) for level in levels] == [(1500, 230), (375, 115)]
    np.testing.assert_array_equal(levels[1].face, finest.face[::16])
    np.testing.assert_allclose(levels[1].rgb, finest.rgb[::16], atol=1e-3)


def test_a_coarser_level_on_no_face_is_refused_and_said(person, tmp_path):
    finest = Gaussians.read(person["train/avatar.npz"])
    off = finest[::4]
    off.face[0] = 99999
    finest.write(tmp_path / "avatar.npz", [off])
    with pytest.raises(BadInput, match="its 1500 gaussians"):
        run(Job(person | {"train/avatar.npz": tmp_path / "avatar.npz"}, tmp_path, ExportConfig()))
