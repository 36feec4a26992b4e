"""What a studio does with the package: its scenes show the people of the project."""

import json

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.light import shade
from gsac.avatar.raster import render
from gsac.avatar.skinning import joint_transforms, skin

pytestmark = pytest.mark.slow

MIRROR = np.diag([-1.0, 1, 1])
SIZE = 256


def decibels(got, want):
    return -10 * np.log10(((got - want) ** 2).mean())


def trainers_picture(given, to_eye, focal, centre, away=0.0):
    """RGB and alpha of the posed person by the trainer's rasteriser; away: m that she is moved on."""
    avatar, pose, transl, weights = given("person")
    rest = avatar.vertices.copy()
    for e, w in enumerate(weights):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        rest[avatar.expression_vertex[span]] += w * avatar.expression_delta[span]
    bones = joint_transforms(pose[None], avatar.joints, avatar.parents)[0]
    vertices = skin(rest, bones, avatar.skin_index, avatar.skin_weight) + transl - (0, avatar.ground, 0)
    g = avatar.gaussians
    frames = face_frames(vertices, avatar.faces)
    bound = bind(frames, g.face, g.mu, g.quat, g.log_scale)
    to_camera = np.diag([1.0, -1, -1])
    total, place = to_camera @ to_eye[:, :3] @ MIRROR, to_camera @ to_eye[:, 3] + (0, 0, away)
    size = np.cbrt(np.linalg.det(total))
    seen = render((bound.means @ total.T + place).astype(np.float32), (total / size @ bound.rotations).astype(np.float32),
                  (bound.scales * size).astype(np.float32), g.rgb * shade(g.light, frames.R[g.face, :, 1]), g.opacity,
                  Camera((focal, focal), centre, SIZE, SIZE))
    return np.concatenate([seen.rgb, seen.alpha[..., None]], 2)


def test_a_scene_that_names_nobody_shows_the_people_of_the_project_edited_played_and_built(play, files):
    lines = play("cast", files / "figure.gsac").splitlines()
    assert lines[0].startswith("standing 0 ") and "avatar.gsac" in lines[0], "says what to do where the project has nobody"
    assert lines[1:3] == ["edited 1 DontSave", "played 5 0 draws 1"], "five people in one draw"
    places = np.array([line.split()[1:] for line in lines[3:8]], float)
    np.testing.assert_allclose(places, [[-1.2, 0, 0], [0, 0, 0], [1.2, 0, 0], [-1.2, 0, -1.2], [0, 0, -1.2]], atol=1e-6)
    assert lines[8:] == ["named 0", "with a deleted prefab 5", "named 1"], (
        "players know their people, scenes in the project stay as they are")


def test_a_file_is_loaded_without_a_halt_may_be_stopped_and_leaves_nothing_where_it_fails(play, files, tmp_path):
    broken = tmp_path / "cut.gsac"
    broken.write_bytes((files / "figure.gsac").read_bytes()[:1000])
    lines = play("load", files / "figure.gsac", broken).splitlines()
    assert lines[:2] == ["at once False", "figure frames True uploads True"], "a buffer or two a frame, all on the main thread"
    assert lines[2:6] == ["draws 1 before True", "buffers 0", "stopped True buffers 0", "play mode ended True buffers 0"]
    assert lines[6].startswith(f"GsacException {broken}: ") and "truncated" in lines[6]
    assert lines[7].startswith("FileNotFoundException ") and "cut.gsac.none" in lines[7]


def test_the_plain_picture_is_the_trainers_at_60_db_with_perspective_and_at_45_without(play, mono, files, given, tmp_path):
    play("paint", files / "person.gsac", files / "person.txt", tmp_path / "painted")
    got = mono.arrays(tmp_path / "painted")
    to_eye = got["toEye"].reshape(3, 4).astype(float)
    want = trainers_picture(given, to_eye, 230, (128 - .1 * 128, 128 - .05 * 128))
    assert (want[..., 3] > .5).mean() > .05, "the person is in the picture"
    assert decibels(got["perspective"].reshape(SIZE, SIZE, 4), want) > 60
    far = 2000.0  # m: there perspective is as good as none
    want = trainers_picture(given, to_eye, .9 * 128 * (far - to_eye[2, 3]), (128 + .1 * 128, 128 + .05 * 128), far)
    assert (want[..., 3] > .5).mean() > .02
    assert decibels(got["flat"].reshape(SIZE, SIZE, 4), want) > 45


def test_a_prefab_has_a_thumbnail_of_head_and_shoulders_and_can_be_clicked_and_framed(play, mono, files, figure, tmp_path):
    said = play("look", files / "figure.gsac", tmp_path / "seen").splitlines()
    got = mono.arrays(tmp_path / "seen")
    picture = got["thumbnail"].reshape(128, 128, 4)[::-1] / 255
    there = picture[..., 3] > .5
    assert .1 < there.mean() < .9 and not there[:3].any() and there[-8:].any(), "from above the crown down to the chest"
    middle = np.average(np.arange(128), weights=there[:40].sum(0))
    assert abs(middle - 64) < 4, "the head is in the middle"
    centre, size = got["framed"].reshape(2, 3)
    assert (size < (2.2, 2.2, 1.2)).all() and size[1] > 1.5
    balls = got["balls"].reshape(-1, 4)
    vertices = figure.vertices * (-1, 1, 1) - (0, figure.ground, 0) + (3, 0, 1)
    assert (abs(vertices - centre) <= size / 2 + .02).all(), "F shows all of the person"
    nearest = (np.linalg.norm(vertices[:, None] - balls[:, :3], axis=2) - balls[:, 3]).min(1)
    assert nearest.max() < .06, "a click on the surface meets a ball"
    assert said == ["frames True", "empty frames False"]


def test_the_self_check_draws_in_each_pipeline_says_where_nobody_is_seen_and_puts_the_project_back(play, files, tmp_path):
    said, *paths, restored = play("self-check", files / "figure.gsac", tmp_path).splitlines()
    assert "avatar.gsac" in said and restored == "restored True"
    good, bad = (json.loads((tmp_path / path).read_text()) for path in paths)
    assert (good["pipeline"], bad["pipeline"]) == ("built-in", "URP")
    assert good["report"] == "gsac-self-check" and good["humanoid"] is True and good["joints"] == 55 and good["gpu"] == 'stub "GPU"'
    assert [view["view"] for view in good["views"]] == ["front", "turned", "orthographic"]
    for there, missing in zip(good["views"], bad["views"], strict=True):
        assert there["mode"] == "mono" and there["decibels"] > 45 and there["person_share"] > .02
        assert there["drawn_share"] > there["person_share"] * .9
        assert missing["drawn_share"] == 0 and missing["decibels"] < 20


def test_in_a_headset_the_self_check_compares_both_eyes(play, files, tmp_path):
    report = json.loads((tmp_path / play("eye-check", files / "figure.gsac", tmp_path).strip()).read_text())
    eyes = report["views"][3:]
    assert [(eye["view"], eye["mode"]) for eye in eyes] == [(f"{side} eye", "SinglePassInstanced") for side in ("left", "right")]
    assert all(eye["decibels"] > 45 and eye["person_share"] > .01 for eye in report["views"])
