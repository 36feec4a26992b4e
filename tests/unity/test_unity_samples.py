"""The package's samples, played over the stubs of Unity and of the packages that they may use."""

from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def sample(play, files):
    """Name of a sample's program -> what it says, line by line."""
    return lambda name: play("samples", name, files / "figure.gsac").splitlines()


def test_two_humanoid_clips_are_blended_without_a_controller(sample):
    missing, blended = sample("Mecanim")
    assert "First and Second" in missing, "says what to drag where"
    assert blended == "walk 0.75 wave 0.25 Animator"


def test_a_timeline_track_adds_up_its_pieces_and_leaves_other_expressions_alone(sample):
    assert sample("Timeline") == ["0.375 0.4", "1 0.4", "0 0.4"]


def test_a_tracked_face_moves_the_person_and_the_body_is_left_to_the_animator(sample):
    assert sample("Faces") == ["no face 0", "seen 0.75 Animator", "lost 0", "copied 0.5"]


def test_twenty_people_begin_one_after_another(sample):
    assert sample("Crowd") == ["playing 3 of 20", "playing 20 of 20"]


def test_the_camera_follows_the_head_until_the_frame_is_drawn_and_stands_at_eye_height_without_one(sample):
    assert sample("Head") == ["1.6", "1 1.25 2"]


def test_in_mixed_reality_the_room_is_shown_hides_what_is_behind_it_and_the_person_stands_on_its_floor(sample):
    missing, shown, hidden, placed, stands, up, on_floor, words, pressed, touched = sample("Reality")
    assert "Gsac Meta Room" in missing
    assert shown.startswith("shown True SolidColor 0 depth True away 3.")
    assert hidden == "shown False Skybox draws 1", "no depth is drawn without the room"
    assert placed == "placed True" and stands == "stands 0.00 0.00 0.40 looks 0.00 1.00", "on the floor, facing the user"
    assert up == "looking up False" and on_floor == "stands 0.00 -0.25 1.00 looks 0.00 1.00"
    assert set(words.split(", ")) == {"A-pose", "T-pose", "walk", "wave", "jawOpen", "browInnerUp", "Place here", "Room"}
    assert pressed == "pressed Script 1 True", "each once, though the finger stays"
    assert touched == "touched right left_wrist; left_wrist; nothing"


def test_what_makers_packages_know_of_room_and_hands_is_asked_of_them(sample):
    assert sample("Makers") == ["False True False True 2 0.2", "False False True 0 False", "False True -10 -9 -0.2 False",
                                "False True 2 False", "False True 0.08"]


def test_the_shader_of_the_rooms_depth_compiles_for_one_eye_and_for_two(hlsl, package, tmp_path):
    text = hlsl.shader_passes(package / "Samples~" / "MixedReality" / "GsacRoomDepth.shader")[""]
    for stand_in in (Path(__file__).parent / "shims", hlsl.STEREO):
        assert all(hlsl.compile_pass(text, tmp_path, stand_in))


def test_the_packages_own_tests_pass_and_ask_for_a_person_where_there_is_none(sample):
    lines = sample("OwnTests")
    assert len(lines) == 10 and len({line.split()[0] for line in lines}) == 5
    assert [line.split(" ", 1)[1] for line in lines] == ["passed"] * 2 + ["ignored"] * 3 + ["passed"] * 5, lines
