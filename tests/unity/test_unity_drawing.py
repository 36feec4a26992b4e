"""When the Unity package draws an avatar, for which cameras, and that nothing is done on the GPU for what nobody sees."""

import re

import numpy as np
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def told(play, files):
    """Situation -> (dispatches, draws), and answers as they stand."""
    lines = dict(line.split(": ") for line in play("cameras", files / "figure.gsac").splitlines())
    return {what: tuple(map(int, said.split())) if said[0].isdigit() else said for what, said in lines.items()}


@pytest.mark.parametrize("where", ["out of view 265", "out of view 95", "out of view 0", "above", "beyond the far plane",
                                   "layer culled", "headset looks away"])
def test_a_person_out_of_view_costs_no_dispatch_and_no_draw(told, where):
    assert told[where] == (0, 0)


def test_a_still_person_before_a_still_camera_is_drawn_without_a_dispatch(told):
    assert told["first"][0] > 2 and told["whole"] == "True", "a new pose is skinned, bound and sorted as the first one"
    assert told["still"] == told["still again"] == told["even light stays even"] == (0, 1)


def test_a_camera_that_moves_only_sorts(told):
    assert told["sort"] == "True" and told["turned"][1] == 1


def test_what_changes_is_seen_at_once(told):
    assert told["expression"] == told["first"]
    assert told["within the far plane"][1] == told["headset"][1] == 1


def test_a_camera_that_is_rendered_by_hand_sees_the_person(told):
    assert told["by hand"][1] == told["by hand in a pipeline"][1] == 1
    assert told["by hand again"] == (0, 1)
    assert told["by hand, posed after the frame's joints were taken"] == (0, 1) and told["by hand, refreshed"] == told["first"]


def test_of_a_camera_that_is_rendered_again_within_a_frame_only_the_last_draw_counts(play, files):
    """Unity keeps the others until the frame ends: a cube's sides, a photograph by the main camera."""
    assert play("repeated", files / "figure.gsac").splitlines() == ["0 counts 0", "0 1 counts 1", "0 1 2 counts 2"]


def test_each_camera_keeps_its_own_order(told):
    assert told["second camera"][0] > 0 and told["first camera after it"] == (0, 1)


def test_prefab_stages_of_others_and_hidden_people_are_left_alone(told):
    assert told["another's prefab stage"] == told["hidden in scene views"] == (0, 0)
    assert told["own prefab stage"][1] == told["scene view"][1] == told["hidden in scene views, the game"][1] == 1


def test_what_was_made_at_run_time_is_destroyed_with_the_last_person(play, files):
    """Materials, and Avatars that no file brought, in play and in edit mode."""
    run = ["two: 3 2", "another file: 2", "off: 3 2", "off: 0 1", "gone: 0 0"]
    assert play("freed", files / "figure.gsac").splitlines() == run * 2


def test_an_avatar_that_is_switched_off_opens_no_file_again_and_casts_no_shadow(play, files):
    """Otherwise the file would stay in memory for good: nobody closes it a second time."""
    assert play("closed", files / "figure.gsac").splitlines() == [
        "on: 1 True", "off: 0 False", "a frame later, the renderer off too: 0 False", "materials: 0"]


def test_another_file_on_the_field_brings_all_its_expressions(play, files):
    assert play("swapped", files / "figure.gsac", files / "person.gsac").splitlines() == ["2 2", "52 52"]


def test_a_lens_that_brings_the_person_near_brings_the_fine_gaussians(play, files, figure):
    """In a file without heights too; and a camera that does not see the person decides nothing, one that does only for itself."""
    counts = [len(level) for level in (figure.gaussians, *figure.coarser)]
    lines = [line.split(": ") for line in play("zoom", files / "figure.gsac").splitlines()]
    drawn = [(who, counts.index(int(n))) for who, n in lines]
    assert drawn == [("far", level) for level in (2, 0, 1, 0, 2)] + [("far", 2), ("near", 0)]


def test_tint_share_fog_and_material_are_set_on_the_component(play, files):
    """The tint as the project's linear colour space has it; a person who has faded away costs nothing."""
    *lines, faded = play("finish", files / "figure.gsac").splitlines()
    names, numbers = zip(*(line.split(" ", 1) for line in lines), strict=True)
    assert names == ("package",) * 5 + ("own", "package")
    half = ((.5 + .055) / 1.055) ** 2.4
    np.testing.assert_allclose([list(map(float, n.split())) for n in numbers], [
        [1, 1, 1, 1, 1], [half, 1, 0, 1, 1], [half, 1, 0, .25, 1], [half, 1, 0, 1, 1], *[[half, 1, 0, 1, 0]] * 3], atol=1e-6)
    assert faded == "faded: 0 0"


def test_stencil_depth_test_and_queue_are_the_materials(hlsl):
    """In every pipeline's pass; the queue is any material's own."""
    text = (hlsl.CORE / "GsacSplats.shader").read_text()
    declared = re.findall(r"^ +(?:\[Enum.*?\] )?(_\w+) \(", text, re.MULTILINE)
    for part in text.split("SubShader\n")[1:]:
        assert sorted(re.findall(r"\[(_\w+)\]", part.split("HLSLPROGRAM")[0])) == sorted(declared)
        assert '"Queue" = "Transparent"' in part
