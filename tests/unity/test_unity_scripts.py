"""The C# of the Unity package, compiled by mcs over stubs of Unity and run under Mono."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.skinning import joint_transforms

pytestmark = pytest.mark.slow

MIRROR = np.diag([-1.0, 1, 1])
ONCE = {
    "GsacAvatar.Open": "a file is read", "GsacAvatar.Unknown": "an error", "GsacAvatar.Complain": "an error",
    "GsacRenderer.Prepare": "a model's first frame",
    "GsacRenderer.Complain": "an error", "GsacCameras.Make": "the first draw",
    "GsacPicture.Resize": "an avatar that grows on the screen",
    "GsacRenderer.NewView": "a camera's first frame", "GsacSorted.Resize": "another file",
    "GsacCameras.Grow": "more people than ever", "GsacCameras.NewCrowd": "people meet", "GsacCrowd.Reserve": "more of them",
    "GsacCrowd.Plan": "others of them", "GsacPoseStream.Prepare": "another file", "GsacReach.Prepare": "another file",
    "GsacBenchmark.Finish": "the end", "GsacColliders.Fit": "another file"}
"""What a frame may call and most frames do not: why."""
KEYS = {"wave": 1.23 * 20 % 64, "walk": 1.23 * 20 % 23}


def unity_bones(avatar, pose, transl):
    """(55, 3, 4): rest -> posed, mirrored, the floor at 0."""
    bones = joint_transforms(pose[None].astype(np.float64), avatar.joints, avatar.parents)[0]
    bones[:, :, 3] += transl
    bones = MIRROR @ bones @ np.diag([-1.0, 1, 1, 1])
    bones[:, 1, 3] -= avatar.ground
    return bones


@pytest.mark.parametrize("name", ["figure", "person"])
def test_smplx_arrays_give_the_bones_and_weights_of_the_trainers_body(play, mono, files, given, tmp_path, name):
    play("pose", files / f"{name}.gsac", files / f"{name}.txt", tmp_path / "pose")
    got = mono.arrays(tmp_path / "pose")
    avatar, pose, transl, weights = given(name)
    np.testing.assert_allclose(got["bones"].reshape(-1, 3, 4), unity_bones(avatar, pose, transl), atol=2e-6)
    np.testing.assert_allclose(got["weights"], weights, atol=1e-5)
    assert abs(avatar.jaw_actions @ pose[22]).max() > .05, "the jaw adds something"


def test_clips_are_sampled_between_keys_and_go_round(play, mono, files, tmp_path):
    play("pose", files / "figure.gsac", files / "figure.txt", tmp_path / "pose")
    got = mono.arrays(tmp_path / "pose")
    avatar = RiggedAvatar.read(files / "figure.gsac")
    for name, key in KEYS.items():
        clip, k, t = avatar.clips[name], int(key), key % 1
        after = (k + 1) % len(clip.rotation)
        truth = np.tile([0.0, 0, 0, 1], (55, 1))
        for n, joint in enumerate(clip.joints):
            a, b = (Rotation.from_rotvec(clip.rotation[i, n]).as_quat() for i in (k, after))
            mixed = (1 - t) * a + t * b * np.sign(a @ b)
            truth[avatar.joint_names.index(joint)] = mixed / np.linalg.norm(mixed) * (1, -1, -1, 1)
        quat = got[f"clip.{name}"].reshape(55, 4)
        np.testing.assert_allclose(quat * np.sign((quat * truth).sum(1, keepdims=True)), truth, atol=2e-5)
        transl = clip.transl[k] * (1 - t) + clip.transl[after] * t
        np.testing.assert_allclose(got[f"transl.{name}"], transl * (-1, 1, 1), atol=1e-5)


def test_the_compiled_code_of_a_frame_makes_no_object(play):
    lines = [line.split(" ", 1) for line in play("allocations", *ONCE).splitlines()]
    assert {name for kind, name in lines if kind == "frame"} == {
        "GsacAvatar.LateUpdate", "GsacRenderer.LateUpdate", "GsacCameras.Draw", "GsacPoseStream.LateUpdate",
        "GsacPoseStream.Listen", "GsacBenchmark.Update", "GsacDemo.LateUpdate", "GsacReach.LateUpdate",
        "GsacHead.Update", "GsacColliders.LateUpdate"}
    assert {name for kind, name in lines if kind == "once"} == ONCE.keys()
    assert [name for kind, name in lines if kind == "makes"] == []
    assert int(lines[-1][1]) > 80, "methods walked"
    unguarded = play("allocations", *(ONCE.keys() - {"GsacRenderer.NewView", "GsacSorted.Resize"}))
    assert "makes GsacRenderer.NewView new GsacView" in unguarded and "makes GsacModel.Empty new GraphicsBuffer" in unguarded


def test_6000_frames_of_each_source_collect_no_garbage(play, files):
    lines = play("garbage", files / "figure.gsac", collector=",nursery-size=128k").split("\n")
    assert int(lines[3].split()[1]) > 0, "the control: one small object a frame is seen"
    assert lines[:3] == [f"{source} 12000 6000 0" for source in ("Animator", "Script", "Clip")]


def test_the_benchmark_shows_three_poses_and_writes_the_percentiles(play, files, tmp_path):
    lines = play("benchmark", files / "figure.gsac", tmp_path).splitlines()
    result = json.loads((tmp_path / lines[0]).read_text())
    assert lines[1] == "3"
    assert abs(result["seconds"] - 20) < .1 and abs(result["frames"] - 20 / .011) < 5
    assert abs(result["median_ms"] - 10) < .02 and abs(result["p95_ms"] - 10) < .02 and abs(result["p99_ms"] - 50) < .02
    assert abs(result["mean_fps"] - 1 / .011) < .5
    assert abs(sum(result["fps_each_second"]) - result["frames"]) <= 100 and 18 <= len(result["fps_each_second"]) <= 21
    assert result["gpu"] == 'stub "GPU"' and result["gaussians"] == len(RiggedAvatar.read(files / "figure.gsac").gaussians)


def test_the_importer_makes_a_prefab_with_a_whole_human_skeleton(play, files, figure):
    lines = play("import", files / "figure.gsac").splitlines()
    assert lines[0] == "figure: prefab data mesh humanoid clip wave clip walk"
    joints = {w[1]: (w[2], np.array(w[3:], float)) for w in map(str.split, lines) if w[0] == "joint"}
    for j, name in enumerate(figure.joint_names):
        parent, place = joints[name]
        assert parent == ("figure" if j == 0 else figure.joint_names[figure.parents[j]])
        np.testing.assert_allclose(place, figure.joints[j] * (-1, 1, 1) - (0, figure.ground, 0), atol=1e-5)
    human = dict(line[6:].split(",") for line in lines if line.startswith("human "))
    assert len(human) == len(set(human.values())) == 55
    assert human["left_wrist"] == "LeftHand" and human["spine3"] == "UpperChest"
    assert human["right_pinky2"] == "Right Little Intermediate"
    assert "skeleton 56" in lines
    volume = float(next(line for line in lines if line.startswith("volume")).split()[1])
    corners = figure.vertices[figure.faces].astype(float)
    outwards = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(outwards, rel=1e-3), "drawn faces look outwards after the mirroring too"
    assert lines[-1] == "draws 1 transforms 57", "an imported prefab is drawn in edit mode and gains no second skeleton"


def test_the_inspectors_buttons_and_sliders_pose_in_edit_mode_and_a_scene_view_is_drawn(play, files):
    lines = [line.split() for line in play("inspector", files / "figure.gsac").splitlines()]
    half = .87 / 2
    a_pose = [0, 0, np.sin(half), np.cos(half)]
    assert [line[0] for line in lines] == ["shoulder", "shoulder", "elbow", "weight", "draws"]
    turns = np.array([line[1:] for line in lines[:3]], float)
    np.testing.assert_allclose(turns, [a_pose, a_pose, [0, .5, 0, .75 ** .5]], atol=1e-6)
    assert lines[3][1] == "0.75"
    assert lines[4] == "draws 1".split(), "not when the avatar is off"


def test_the_demo_scene_plays_from_its_file_and_its_buttons_pose_and_turn(play, files, figure):
    lines = [line.rsplit(" ", 4) for line in play("demo", files / "figure.gsac").splitlines()]
    turned = {line[0]: np.array(line[1:], float) for line in lines[:5]}
    half = .87 / 2
    np.testing.assert_allclose(turned["T-pose"], [0, 0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(turned["A-pose"], [0, 0, -np.sin(half), np.cos(half)], atol=1e-6)
    for name in ("start", "walk"):  # clips play: the arm stands 10 degrees and more from where the still poses have it
        assert max(abs(turned[name] @ turned[still]) for still in ("T-pose", "A-pose")) < np.cos(np.radians(5)), name
    before, after = (np.array(" ".join(line).split()[1:], float) - (0, .9, 0) for line in lines[5:7])
    assert before[2] > 3 and abs(before[0]) < 1e-3, "the camera sees the person's front"
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before) * np.exp(-.15), rel=1e-4)
    assert np.arctan2(after[0], after[2]) == pytest.approx(np.radians(27), abs=1e-3)
    assert " ".join(lines[7]) == "draws 301"


def test_the_importer_says_what_is_wrong_with_a_file(play, files, tmp_path):
    path = tmp_path / "cut.gsac"
    path.write_bytes((files / "figure.gsac").read_bytes()[:1000])
    said = play("import", path)
    assert said.startswith("error: ") and "cut.gsac" in said and "truncated" in said
    with open(path, "wb") as f:
        f.truncate((256 << 20) + 1)
    assert "oversized" in play("import", path, heap="32m"), "before it is read"


def test_instances_share_buffers_a_new_avatar_replaces_an_old_and_all_is_given_back(play, files):
    lines = play("life", files / "figure.gsac").splitlines()
    assert lines[:4] == ["draws 2", "draws 4, more buffers True, transforms 57", "draws 4 looking away", "buffers 0"]


def test_wrong_calls_name_the_avatar_and_the_word(play, files):
    lines = play("life", files / "figure.gsac").splitlines()[4:]
    assert lines[:4] == [f"ArgumentException: one has no {what}" for what in
                         ("joint `tail`", "expression `sneeze`", "pose `X`", "clip `fly`")]
    assert "4 numbers" in lines[4] and "600 numbers" in lines[5] and "not_gsac" in lines[6] and "`Asset`" in lines[7]
    assert lines[8].startswith("1 lame: the avatar cannot be drawn"), "said once, not each frame"


def test_coarser_levels_are_drawn_from_afar_and_do_not_flicker_where_they_change(play, files, figure):
    counts = [len(level) for level in (figure.gaussians, *figure.coarser)]
    drawn = [counts.index(int(n)) for n in play("levels", files / "figure.gsac").split()]
    assert drawn == [0, 1, 2, 2, 0, 0, 1, 1, 0], "at 3, 12, 30, 300, 3, 8.5, 9.2, 8.5 and 7.9 m; they change at 8 and 16"


@pytest.fixture(scope="module")
def levelled(figure, tmp_path_factory):
    """The figure's file with levels up to 270 and 135 px, how many gaussians each has, and the rest shape's height, m."""
    coarser = [replace(level, max_height_px=height) for level, height in zip(figure.coarser, (270, 135), strict=True)]
    path = tmp_path_factory.mktemp("levelled") / "figure.gsac"
    path.write_bytes(avatar_bytes(replace(figure, coarser=coarser)))
    return path, [len(level) for level in (figure.gaussians, *coarser)], np.ptp(figure.vertices[:, 1])


def test_the_persons_height_on_the_screen_decides_the_level_and_a_tenth_of_it_keeps_the_one_of_before(play, levelled):
    path, counts, stature = levelled
    heights = [400, 265, 250, 235, 250, 265, 275, 128, 115, 128, 60, 1000]
    asked = [word for height in heights for word in (100, 2 * 100 / stature, height, "one")]  # the px alone change
    drawn = [counts.index(int(n)) for n in play("heights", path, *asked).split()]
    assert drawn == [0, 0, 0, 1, 1, 1, 0, 1, 2, 2, 2, 0]
    asked = [word for away in (20, 40, 80, 160) for word in (away, 2 * 40 / stature, 250, "one")]
    drawn = [counts.index(int(n)) for n in play("heights", path, *asked).split()]
    assert drawn == [0, 0, 1, 2], "500, 250, 125 and 62 px in pictures of one size: 250 and 125 are within a tenth of 270 and 135"


def test_the_larger_eye_of_a_headset_decides_and_without_perspective_the_distance_does_not(play, levelled):
    path, counts, stature = levelled
    focal = 2 * 100 / stature
    asked = [(100, focal, 400, "left"), (100, focal, 400, "right"), (100, focal, 200, "left"), (100, focal / 100, 200, "flat"),
             (5000, focal / 100, 400, "flat"), (1, focal / 100, 100, "flat"), (100, focal, 400, "hidden")]
    drawn = [int(n) for n in play("heights", path, *(word for row in asked for word in row)).split()]
    assert drawn == [counts[0], counts[0], counts[1], counts[1], counts[0], counts[2], 0]


def test_every_level_is_bound_in_the_light_of_the_file_as_far_as_the_component_says(play, files, tmp_path, figure):
    light = np.linspace(-.4, .7, 12, dtype=np.float32).reshape(4, 3)
    (tmp_path / "lit.gsac").write_bytes(avatar_bytes(replace(figure, gaussians=replace(figure.gaussians, light=light))))
    got = np.array([line.split() for line in play("light", tmp_path / "lit.gsac").splitlines()], float)
    mirrored = (light[[1, 2, 3, 0]] * np.float32([[1], [-1], [1], [1]])).T
    even = np.tile([0, 0, 0, 1], (3, 1))
    assert [row[0] for row in got] == [len(g) for g in (figure.gaussians, figure.coarser[-1])] * 4
    for row, strength in zip(got, np.repeat([1, .25, 0, 1], 2), strict=True):
        np.testing.assert_allclose(row[1:].reshape(3, 4), (1 - strength) * even + strength * mirrored, atol=1e-6)
    got = [line.split()[1:] for line in play("light", files / "figure.gsac").splitlines()]
    np.testing.assert_array_equal(np.array(got, float).reshape(-1, 3, 4), np.tile(even, (2, 1, 1)), "once a level: nothing changes")


def test_every_stub_of_unity_has_its_page_and_first_version_and_none_is_newer_than_the_package_asks_for():
    folder = Path(__file__).with_name("stubs")
    declared = set()
    for path in folder.glob("*.cs"):
        if path.name != "Player.cs":
            kinds = r"public (?:static |sealed |abstract |partial )*(?:class|struct|enum) (\w+)"
            declared |= set(re.findall(kinds, path.read_text()))
    rows = [line.strip("| ").split(" | ") for line in (folder / "API.md").read_text().splitlines() if line.startswith("| `")]
    assert {row[0].strip("`") for row in rows} == declared
    for name, page, first, members in rows:
        assert page.startswith("https://docs.unity3d.com/ScriptReference/"), name
        for version in [first, *re.findall(r"\((\d+\.\d+)\)", members)]:
            assert tuple(map(int, version.split("."))) <= (2021, 3), f"{name} is from {version}"
