"""What drives an avatar in Unity: streams over an Animator, blend shapes, clips, the inspector; and what must not."""

import socket
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.skinning import joint_transforms, skin

pytestmark = pytest.mark.slow


def told(text):
    """First words of a line -> its numbers."""
    out = {}
    for line in text.splitlines():
        words = line.split()
        n = len(words)
        while n and words[n - 1].lstrip("-").replace(".", "", 1).replace("E-", "").isdigit():
            n -= 1
        out[" ".join(words[:n])] = np.array(words[n:], float)
    return out


@pytest.fixture(scope="module")
def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def streamed(play, files, free_port):
    """Mask -> degrees of shoulder, elbow, index finger and jaw, which an Animator holds at 60; the root's x, m; jawOpen."""
    return told(play("parts", files / "figure.gsac", free_port))


def test_a_stream_of_the_face_alone_leaves_body_and_animator_as_they_are(streamed):
    got = streamed["face-only Animator True"]
    np.testing.assert_allclose(got[:4], 60, atol=.01)
    assert abs(got[5] - .5) < 1e-3


def test_a_stream_begins_where_the_joint_stands(streamed):
    apart = Rotation.from_rotvec([0, 0, np.pi / 3]).inv() * Rotation.from_rotvec([0, 1.5, 0])
    assert 5 < streamed["began"] < .35 * np.degrees(apart.magnitude())


@pytest.mark.parametrize("parts, moved, x", [("Hands", {2}, 0), ("Face", {3}, 0), ("Body", {1}, 1), ("All", {1, 2, 3}, 1),
                                             ("Face+Hands", {2, 3}, 1)])
def test_a_stream_moves_the_chosen_parts_over_an_animator_and_gives_the_others_back(streamed, parts, moved, x):
    got = streamed[f"{parts} Animator True"]
    live = np.degrees([0, 1.5, .5, .2])
    np.testing.assert_allclose(got[:4], [live[i] if i in moved else 60 for i in range(4)], atol=.05)
    assert got[4] == pytest.approx(x, abs=.01), "no Animator moves the root back"
    assert got[5] == pytest.approx(.5 if parts == "Hands" else .9, abs=1e-3)


def test_props_and_a_second_person_in_the_hand_take_no_joint_over(play, files):
    assert play("props", files / "figure.gsac").splitlines() == ["taken over 0", "children 3 True"]


def test_another_person_takes_the_place_of_one_and_the_users_things_stay(play, files, figure, tmp_path):
    taller = replace(figure, joints=figure.joints * np.float32(1.1), vertices=figure.vertices * np.float32(1.1))
    names = ["skull" if name == "head" else name for name in figure.joint_names]
    (tmp_path / "taller.gsac").write_bytes(avatar_bytes(taller))
    (tmp_path / "skull.gsac").write_bytes(avatar_bytes(replace(figure, joint_names=names, clips={})))
    lines = play("swap", files / "figure.gsac", tmp_path / "taller.gsac", tmp_path / "skull.gsac").splitlines()
    assert lines[0] == "alive True person head same joints True people 3"
    assert told("\n".join(lines[1:3])).keys() == {"elbow", "head"}
    got = told("\n".join(lines[1:3]))
    np.testing.assert_allclose(got["elbow"], 0, atol=1e-4)
    head = taller.joints[taller.joint_names.index("head")] * (-1, 1, 1) - (0, taller.ground, 0)
    np.testing.assert_allclose(got["head"], head, atol=2e-4)
    assert lines[3].startswith("refused: ") and lines[3].endswith("still there True True")
    assert lines[4] == "other joints: alive True person person old head False new True moved False"


@pytest.fixture(scope="module")
def broken(play, files, tmp_path_factory):
    """Lines: of a file cut short, and of a whole one in its place."""
    cut = tmp_path_factory.mktemp("broken") / "cut.gsac"
    cut.write_bytes((files / "figure.gsac").read_bytes()[:1000])
    return play("broken", cut, files / "figure.gsac").splitlines()


def test_a_broken_file_is_read_once_and_said_once(broken):
    first, calls = broken[:2]
    assert first.startswith("read 1 said 1: person: the avatar cannot be drawn: ") and "truncated" in first
    assert calls.startswith("calls say ") and "truncated" in calls


def test_a_good_file_in_a_broken_ones_place_is_drawn(broken):
    assert broken[2] == "said 1 draws 1"


@pytest.fixture(scope="module")
def nudged(play, files):
    return told(play("nudge", files / "figure.gsac"))


def test_the_inspectors_sliders_begin_where_the_joint_stands(nudged):
    arm = Rotation.from_quat(nudged["a-pose"])
    assert np.degrees((arm.inv() * Rotation.from_quat(nudged["nudged"])).magnitude()) == pytest.approx(1, abs=.05)
    fresh = Rotation.from_quat(nudged["fresh"]).as_euler("YXZ", degrees=True)  # Unity turns about z, then x, then y
    np.testing.assert_allclose(fresh, [20, 50, 30], atol=.05)


def test_an_angle_beyond_the_upright_stays_as_it_was_put_in(nudged):
    far = Rotation.from_euler("YXZ", [20, 120, 30], degrees=True)
    assert np.degrees((far.inv() * Rotation.from_quat(nudged["far"])).magnitude()) < .05


def test_what_was_undone_stays_undone_when_another_joint_is_turned(nudged):
    np.testing.assert_allclose(nudged["undone"], nudged["still"], atol=1e-4)
    assert abs(nudged["undone"] - nudged["far"]).max() > .1


def test_an_expression_of_the_inspector_is_undone(nudged):
    np.testing.assert_allclose(nudged["weight"], [.75, 0])


def test_the_inspector_changes_all_chosen_people(play, files, package):
    assert [line.split() for line in play("several", files / "figure.gsac").splitlines()] == [["walk", "60", "0.25"]] * 2
    assert "[CanEditMultipleObjects]" in (package / "Editor" / "GsacAvatarEditor.cs").read_text()


@pytest.fixture(scope="module")
def played(play, files):
    """Lines of a person who plays clips of the file; the first number is how far the pose is from the one expected, degrees."""
    lines = play("clip", files / "figure.gsac").splitlines()
    return told("\n".join(lines[:-1])), lines[-1]


def test_another_clip_may_be_chosen_while_one_plays_and_goes_at_its_speed(played):
    assert [played[0][which][0] for which in ("wave", "walk", "half", "back")] == [0] * 4


def test_a_clip_that_does_not_begin_anew_stands_at_its_end_and_says_so_once(played):
    assert played[0]["once"].tolist() == [0, 0, 1] and played[0]["begin"].tolist() == [0, 2] and played[0]["always"] == 2


def test_a_clip_that_is_not_there_is_said_with_those_that_are(played):
    assert played[1] == "1 figure has no clip `wlak`; it has wave, walk"


def test_pose_and_expression_of_edit_mode_are_saved_with_the_scene(play, files):
    got = told(play("saved", files / "figure.gsac"))
    np.testing.assert_allclose(got["saved Script"], [np.sin(.87 / 2), .75], atol=1e-4)


def test_a_loaded_person_has_the_body_with_the_expressions_as_blend_shapes(play, mono, files, figure, tmp_path):
    lines = play("body", files / "figure.gsac", files / "figure.txt", tmp_path / "body").splitlines()
    got = mono.arrays(tmp_path / "body")
    assert lines == ["person Body enabled True root bone pelvis", "shared True", "on again True True 0.5"]
    np.testing.assert_allclose(got["vertices"].reshape(-1, 3), figure.vertices * (-1, 1, 1), atol=1e-6)
    figure = RiggedAvatar.read(files / "figure.gsac")
    for e, name in enumerate(figure.expression_names):
        span = slice(figure.expression_start[e], figure.expression_start[e + 1])
        moved = np.zeros_like(figure.vertices)
        np.add.at(moved, figure.expression_vertex[span], figure.expression_delta[span])
        np.testing.assert_allclose(got[f"shape.{name}"].reshape(-1, 3), moved * (-1, 1, 1), atol=1e-7)


def test_a_blend_shape_that_moves_in_edit_mode_has_the_person_drawn_anew_and_one_at_rest_has_not(play, files):
    assert play("face", files / "figure.gsac").splitlines() == ["drawn 0", "still 0", "drawn 0.6", "still 0.6"]


def test_the_body_has_the_face_of_the_gaussians_the_jaws_turn_too(play, mono, files, given, tmp_path):
    play("body", files / "person.gsac", files / "person.txt", tmp_path / "body")
    avatar, pose, _, weights = given("person")
    moved = np.zeros_like(avatar.vertices)
    for e, weight in enumerate(weights):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        np.add.at(moved, avatar.expression_vertex[span], weight * avatar.expression_delta[span])
    got = mono.arrays(tmp_path / "body")["moved"].reshape(-1, 3) * (-1, 1, 1)
    assert abs(got - moved).max() < 1e-5
    assert abs(avatar.jaw_actions @ pose[22]).max() > .05, "the jaw adds something"


def test_the_bodys_bounds_about_its_root_bone_hold_it_in_every_pose(play, mono, files, figure, tmp_path):
    play("body", files / "figure.gsac", files / "figure.txt", tmp_path / "body")
    centre, size = mono.arrays(tmp_path / "body")["bounds"].reshape(2, 3)
    rng = np.random.default_rng(3)
    for turn in (0, .3, 2):
        bones = joint_transforms(rng.normal(size=(1, 55, 3)) * turn, figure.joints, figure.parents)[0]
        vertices = skin(figure.vertices, bones, figure.skin_index, figure.skin_weight)
        pelvis = np.vstack([bones[0], [0, 0, 0, 1]]) @ np.block([[np.eye(3), figure.joints[0][:, None]], [0, 0, 0, 1]])
        there = (np.linalg.inv(pelvis) @ np.c_[vertices, np.ones(len(vertices))].T).T[:, :3] * (-1, 1, 1)
        assert (abs(there - centre) <= size / 2).all()
    assert size.max() < 6


def test_the_clips_of_the_file_become_humanoid_animation_clips(play, mono, files, figure, tmp_path):
    lines = play("clips", files / "figure.gsac", tmp_path / "clips").splitlines()
    assert lines == ["left turned by 0", "wave 20 True True", "walk 20 True True"]
    got = mono.arrays(tmp_path / "clips")
    muscles = {name.split(".", 1)[1] for name in got if name.startswith("walk/:_Animator.")}
    assert len(muscles) == 7 + 95
    assert {"RootQ.w", "LeftHand.Thumb.1_Stretched", "RightHand.Little.Spread", "Left_Lower_Leg_Twist_In-Out"} <= muscles
    assert not any(name.startswith(("Left_Thumb", "Right_Index")) for name in muscles)
    for name, clip in RiggedAvatar.read(files / "figure.gsac").clips.items():
        keys, fps = len(clip.rotation), 20
        curve = {which: got[f"{name}/:_Animator.{which}"] for which in muscles}
        assert all(values[0] == pytest.approx(keys / fps) and len(values) == 4 * keys + 1 for values in curve.values())
        np.testing.assert_allclose(curve["RootT.y"][1::4], clip.transl[:, 1] + figure.joints[0, 1] - figure.ground, atol=1e-5)
        turned = np.zeros((keys, 55))
        turned[:, [figure.joint_names.index(joint) for joint in clip.joints]] = np.sin(np.linalg.norm(clip.rotation, axis=2) / 2)
        order = depth_first(figure.parents)
        for muscle, joint in (("Spine_Front-Back", order[0]), ("UpperChest_Left-Right", order[7]), ("Jaw_Left-Right", order[20])):
            np.testing.assert_allclose(curve[muscle][1::4], abs(turned[:, joint]), atol=1e-5)
            between = (curve[muscle][1::4] + np.roll(curve[muscle][1::4], -1)) / 2
            np.testing.assert_allclose(curve[muscle][3::4], between, atol=1e-5, err_msg="straight from key to key")
        q = np.stack([curve[f"RootQ.{axis}"][1::4] for axis in "xyzw"], 1)
        assert ((q[1:] * q[:-1]).sum(1) > 0).all(), "the turn's sign does not flip from key to key"


def test_hands_and_feet_reach_places_and_bend_as_people_do(play, files):
    got = told(play("reach", files / "figure.gsac"))
    for end, side in (("LeftHand", -1), ("RightHand", -1), ("LeftFoot", 1), ("RightFoot", 1)):
        off, stretched, shrunk, bent = got[f"{end} True"]
        assert off < 1e-3 and stretched < 1e-3 and shrunk < 1e-4 and bent == side, end
    np.testing.assert_allclose(got["goal"], [0, 1], atol=1e-3)
    assert got["free"] == pytest.approx(60, abs=.01), "the Animator's again"
    np.testing.assert_allclose(got["round"], [1, 0, 0], atol=2e-4, err_msg="a way round leaves no twist, and the arm is given back")
    np.testing.assert_allclose(got["handles"], [4, 0, 0], atol=1e-3)


def depth_first(parents):
    """Joints in the order in which they hang: each before its children, these one after the other."""
    order, waiting = [], [0]
    while waiting:
        joint = waiting.pop(0)
        order.append(joint)
        waiting = [j for j in range(1, len(parents)) if parents[j] == joint] + waiting
    return order
