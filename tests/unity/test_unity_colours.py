"""A project with linear colours shows the trained picture, which was composited in display colours: scripts, and a software GPU."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.srgb import to_display
from gsac.benchmarks.unity import colours
from gsac.benchmarks.unity.shaders import STEREO

pytestmark = pytest.mark.slow

SIZE = 192
BACKGROUND = .5
SKY = 4.0
"""Linear light of a bright sky, 1 being white after exposure."""


@pytest.fixture(scope="module")
def avatar(exported):
    return RiggedAvatar.read(exported / "avatar.gsac")


@pytest.fixture(scope="module")
def shot(avatar):
    return colours.make_shots(avatar, SIZE, 1, seed=3)[0]


@pytest.fixture(scope="module", params=sorted(colours.BEHIND))
def stage(request, gpu, avatar, shot):
    programs = colours.compile_programs(request.param, Path(__file__).parent / "shims")
    stage = colours.Stage(gpu, programs, avatar, SIZE)
    stage.put(shot, avatar.gaussians)
    stage.draw_own(shot)
    return stage


def test_a_linear_project_shows_the_trained_picture_at_40_db_whatever_lies_behind(stage, shot, avatar):
    rgb, alpha = colours.trained_picture(shot, avatar.faces, avatar.gaussians)
    person = alpha > colours.EDGE
    assert person.mean() > .05, "the figure is in the picture"
    unknown, direct = [], []
    for background in colours.BACKGROUNDS:
        want = rgb + (1 - alpha[..., None]) * background
        unknown.append(colours.decibels(stage.lay(shot, background, known=False), want, alpha >= 0))
        direct.append(colours.decibels(stage.draw_direct(shot, background), want, alpha >= 0))
        assert colours.decibels(stage.lay(shot, background, known=True), want, person) > 45
    print(f"not knowing what lies behind: {min(unknown):.1f} dB; as one draw: {min(direct):.1f} dB")
    assert min(unknown) > 40 and min(unknown) > min(direct) + 3


@pytest.mark.parametrize("exposure", [1, .5, .05])
def test_before_a_bright_sky_the_copy_behind_gives_the_trained_edges_at_any_exposure(stage, shot, avatar, exposure):
    """What is drawn and what is copied are in the frame's exposure already: nothing is undone."""
    rgb, alpha = colours.trained_picture(shot, avatar.faces, avatar.gaussians)
    sky = float(to_display(np.asarray(SKY * exposure)))
    want = rgb + (1 - alpha[..., None]) * sky
    known, unknown = (colours.decibels(stage.lay(shot, sky, known), want, alpha > colours.EDGE) for known in (True, False))
    print(f"sky of display value {sky:.2f}: {known:.1f} dB, without the copy {unknown:.1f}")
    assert known > 45 and known > unknown + 3


def test_what_stands_before_the_person_hides_her_and_what_stands_behind_does_not(stage, shot):
    seen = stage.lay(shot, BACKGROUND, known=False)
    near, away = .01, shot.vertices[:, 2]
    depth = lambda metres: 1 - 2 * near / metres  # noqa: E731, of the tests' projection
    hidden = stage.lay(shot, BACKGROUND, known=False, far=depth(away.min() - .2))
    shown = stage.lay(shot, BACKGROUND, known=False, far=depth(away.max() + .2))
    assert abs(seen - BACKGROUND).max() > .2
    np.testing.assert_allclose(hidden, BACKGROUND, atol=1e-3)
    np.testing.assert_array_equal(shown, seen)


@pytest.fixture(scope="module")
def told(play, mono, files, tmp_path_factory):
    """(situation -> splats drawn to a picture, quads to the scene, pictures, linear colours; what the pictures are drawn with)."""
    path = tmp_path_factory.mktemp("picture") / "asked"
    lines = dict(line.split(": ") for line in play("picture", files / "figure.gsac", path).splitlines())
    return {what: tuple(map(int, words.split())) for what, words in lines.items()}, mono.arrays(path)


def test_a_picture_of_the_avatar_alone_is_drawn_for_a_camera_and_two_triangles_lay_it_over_the_scene(told, figure):
    count = len(figure.gaussians)
    for lens in ("wide", "flat", "again"):
        assert told[0][lens] in [(n, 1, 2, 0) for n in (count, *map(len, figure.coarser))]
    assert told[0]["part of a screen"][:2] == (told[0]["again"][0], 1) and told[0]["copy"] == (0,)


def test_hdrp_is_believed_to_have_a_copy_of_what_lies_behind_only_where_the_cameras_settings_have_refraction(told):
    said = {what: numbers[0] for what, numbers in told[0].items() if "refraction" in what}
    assert said == {"other pipeline with refraction": 0, "other pipeline without refraction": 0,
                    "HDRP with refraction": 1, "HDRP without refraction": 0}


def test_a_headset_gets_a_part_of_the_picture_for_each_eye(told):
    assert told[0]["headset"] == (2 * told[0]["again"][0], 1, 2, 0)


@pytest.mark.parametrize("eyes", ["", "headset, "])
def test_who_wants_it_so_gets_the_splats_themselves(told, eyes):
    assert told[0][f"{eyes}switched off"][:2] == (0, told[0]["again"][0])
    assert told[0][f"{eyes}switched off"][3] == 1


def test_pictures_are_kept_while_the_person_comes_nearer_and_freed_with_the_renderer(told):
    assert told[0]["new pictures in a walk of a metre"][0] < 8
    assert told[0]["gone"] == (0, 0)


@pytest.mark.parametrize("lens", ["wide", "tele", "flat"])
def test_the_picture_holds_the_avatar_pixel_for_pixel_of_the_screen(told, lens):
    asked = {name.removeprefix(f"{lens}."): array for name, array in told[1].items() if name.startswith(lens)}
    P, view, crop = (asked[name].reshape(4, 4).astype(float) for name in ("lens", "GsacEyeView", "GsacEyeProjection"))
    (left, low, right, top), (sx, sy, mx, my) = asked["GsacEyeRect"], asked["GsacEyeLens"]
    eye = np.c_[told[1]["joints"].reshape(-1, 3), np.ones(55)] @ view.T
    clip = eye @ P.T
    place = clip[:, :2] / clip[:, 3:]
    got = eye @ crop.T
    wanted = (place - [left, low]) / [right - left, top - low] * 2 - 1
    np.testing.assert_allclose(got[:, :2] / got[:, 3:], wanted * [1, -1], atol=2e-4)
    inside = (abs(place) < 1).all(1)
    assert inside.any() and (abs(wanted[inside]) < 1).all()
    pixels = (np.array([left, low, right, top]) + 1) / 2 * [1920, 1080, 1920, 1080]
    np.testing.assert_allclose(pixels, np.round(pixels), atol=1e-2)
    np.testing.assert_allclose([pixels[2] - pixels[0], pixels[3] - pixels[1]], asked["size"], atol=1e-2)
    # the shader's corner goes through the camera to where it is on the screen
    away = asked["GsacEyeScreen"][2]
    corner = np.array([(left + mx) / sx, (top + my) / sy, -1, 1]) * ([1, 1, away, 1] if lens == "flat" else [away, away, away, 1])
    back = P @ corner
    np.testing.assert_allclose(back[:2] / back[3], [left, top], atol=1e-5)


def test_each_eyes_part_holds_what_the_eye_sees_pixel_for_pixel(play, mono, files, tmp_path):
    play("headset", files / "figure.gsac", tmp_path / "asked")
    asked = mono.arrays(tmp_path / "asked")
    assert asked["GsacParts"].tolist() == [2, 2], "two parts, each drawn once"
    wide, high = asked["size"] / [2, 1]
    joints = np.c_[asked["joints"].reshape(-1, 3), np.ones(55)]
    for eye in (0, 1):
        own = {name.removeprefix(f"{eye}."): array for name, array in asked.items() if name.startswith(f"{eye}.")}
        view, lens, crop = (own[name].reshape(4, 4).astype(float) for name in ("view", "lens", "GsacEyeProjection"))
        np.testing.assert_array_equal(own["GsacEyeView"], own["view"])
        np.testing.assert_array_equal(own["part"], [eye * wide, 0, wide, high])
        np.testing.assert_allclose(view @ [*own["GsacEyePlace"][:3], 1], [0, 0, 0, 1], atol=1e-5)
        left, low, right, top = own["GsacEyeRect"]
        seen, got = joints @ view.T @ lens.T, joints @ view.T @ crop.T
        wanted = (seen[:, :2] / seen[:, 3:] - [left, low]) / [right - left, top - low] * 2 - 1
        np.testing.assert_allclose(got[:, :2] / got[:, 3:], wanted * [1, -1], atol=2e-4)
    assert abs(asked["0.GsacEyePlace"] - asked["1.GsacEyePlace"]).max() > .05


@pytest.fixture(scope="module", params=sorted(colours.BEHIND))
def headset(request, gpu, avatar, shot):
    programs = colours.compile_programs(request.param, STEREO, Path(__file__).parent / "shims")
    stage = colours.Stage(gpu, programs, avatar, SIZE, eyes=2)
    stage.put(shot, avatar.gaussians)
    stage.draw_own(shot)
    return stage


def test_each_eye_of_a_headset_sees_its_trained_picture_at_40_db_in_a_linear_project(headset, shot, avatar):
    pictures = []
    for eye in (0, 1):
        rgb, alpha = colours.trained_picture(headset.seen_by(shot, eye), avatar.faces, avatar.gaussians)
        pictures.append(rgb)
        unknown, direct = [], []
        for background in colours.BACKGROUNDS:
            want = rgb + (1 - alpha[..., None]) * background
            known = colours.decibels(headset.lay(shot, background, known=True, eye=eye), want, alpha > colours.EDGE)
            assert known > 45, f"eye {eye} before {background}"
            unknown.append(colours.decibels(headset.lay(shot, background, known=False, eye=eye), want, alpha >= 0))
            direct.append(colours.decibels(headset.draw_direct(shot, background, eye), want, alpha >= 0))
        print(f"eye {eye}: not knowing what lies behind {min(unknown):.1f} dB; as one draw {min(direct):.1f} dB")
        assert min(unknown) > 40 and min(unknown) > min(direct) + 3
    assert abs(pictures[0] - pictures[1]).max() > .3, "the eyes see different things"


@pytest.mark.parametrize("headset", ["", "UniversalPipeline"], indirect=True)  # HDRP's copy has no alpha
def test_before_the_real_room_a_headset_draws_edges_as_for_what_nobody_knows(headset, shot):
    unknown, room = (headset.lay(shot, .75, known, eye=1, room=known) for known in (False, True))
    np.testing.assert_array_equal(room, unknown)
    assert abs(headset.lay(shot, .75, known=True, eye=1) - unknown).max() > .02


def test_a_tinted_and_a_fading_person_look_as_without_a_picture_of_their_own(stage, shot, monkeypatch):
    usual = stage.parameters
    monkeypatch.setattr(stage, "parameters", lambda *of: usual(*of) | {"GsacTint": [.3, 1, .6, .5]})
    stage.draw_own(shot)
    got, want = stage.lay(shot, BACKGROUND, known=False), stage.draw_direct(shot, BACKGROUND)
    monkeypatch.undo()
    stage.draw_own(shot)
    shown = abs(got - BACKGROUND).max(2) > .02
    assert .4 < shown.sum() / (abs(stage.lay(shot, BACKGROUND, known=False) - BACKGROUND).max(2) > .02).sum() < .6
    assert colours.decibels(got, want, shown) > 28
