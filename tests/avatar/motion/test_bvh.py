import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gsac.avatar.motion import source as motion_source
from gsac.avatar.motion.bvh import read_bvh
from gsac.avatar.motion.source import MAX_BYTES, MotionError
from support import dances

SMALL = """HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0 50 0
    CHANNELS 3 Yrotation Zrotation Xrotation
    End Site
    {
      OFFSET 0 10 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.05
1 2 3 90 0 0 0 0 0
1 2 3 0 0 0 30 20 10
"""


def test_positions_take_the_offsets_place_and_angles_turn_in_the_order_of_the_channels():
    source = dances.read_text(SMALL)
    assert (source.names, source.parents.tolist(), source.fps) == (["Hips", "Chest"], [-1, 0], 20)
    np.testing.assert_allclose(source.places[0], [[1, 2, 3], [-49, 2, 3]], atol=1e-9)
    np.testing.assert_allclose(source.rest_places, [[0, 90, 0], [0, 140, 0]])
    want = Rotation.from_euler("YZX", [30, 20, 10], degrees=True)
    assert (Rotation.from_quat(source.turns[1, 1]).inv() * want).magnitude() < 1e-9


def test_windows_line_ends_tabs_and_names_with_spaces_are_read():
    source = dances.read_text(SMALL.replace("\n", "\r\n").replace("  ", "\t").replace("ROOT Hips", "ROOT Bip01 Pelvis"))
    assert source.names[0] == "Bip01 Pelvis" and len(source.places) == 2


@pytest.mark.parametrize(("old", "new", "line", "why"), [
    ("HIERARCHY", "HIER", 1, "HIERARCHY"), ("ROOT", "JOINT", 2, "ROOT"), ("0 90 0", "0 ninety 0", 4, "number"),
    ("0 90 0", "0 nan 0", 4, "finite"), ("CHANNELS 6", "CHANNELS 7", 5, "channels"), ("Xposition", "Wposition", 5, "Wposition"),
    ("Frames: 2", "Frames: 0", 17, "frames"), ("Frames: 2", "Frames: 3", 20, "cut off"), ("Frames: 2", "Frames: 1", 20, "more"),
    ("Frames: 2", "Frames: 1e300", 20, "cut off"), ("0.05", "0", 18, "frame time"),
    ("90 0 0 0 0 0", "90 0 0 0 0", 19, "9 channels"),
    ("30 20 10", "30 x 10", 20, "numbers"), ("30 20 10", "30 inf 10", 20, "finite"), ("30 20 10", "30 1e300 10", 20, "beyond"),
    ("0 90 0", "0 -1e300 0", 4, "beyond"), ("MOTION", "ROOT x", 16, "second ROOT"),
    ("OFFSET 0 10 0\n    }", "OFFSET 0 10 0", 15, "MOTION"), ("JOINT Chest", "JOINT", 7, "name")])
def test_a_fault_names_the_file_and_the_line(tmp_path, old, new, line, why):
    path = tmp_path / "dance.bvh"
    path.write_text(SMALL.replace(old, new, 1))
    with pytest.raises(MotionError) as e:
        read_bvh(path)
    assert f"dance.bvh, line {line}: " in str(e.value) and why in str(e.value)


def test_a_file_cut_anywhere_is_a_named_error():
    for cut in range(len(SMALL) - 2):
        if SMALL[:cut].split() != SMALL.split():
            try:
                dances.read_text(SMALL[:cut], "cut.bvh")
            except MotionError as e:
                assert "cut.bvh, line " in str(e)
            else:
                assert len(SMALL[:cut].splitlines()[-1].split()) == 9, "the last number alone may be shorter"


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.binary(max_size=40), st.integers(0, len(SMALL)), st.integers(0, 40))
def test_fuzz_any_damage_gives_a_named_error_or_a_motion(noise, at, removed):
    text = SMALL[:at] + noise.decode("latin-1") + SMALL[at + removed:]
    try:
        source = dances.read_text(text)
    except MotionError:
        return
    assert np.isfinite(source.places).all() and np.isfinite(source.turns).all()


def test_a_skeleton_without_end_and_a_huge_file_are_refused_at_once(tmp_path):
    deep = "HIERARCHY\nROOT a\n{\n" + "JOINT b\n{\n" * 100_000
    began = time.process_time()
    with pytest.raises(MotionError, match="generations"):
        dances.read_text(deep)
    with open(tmp_path / "huge.bvh", "wb") as f:
        f.truncate(MAX_BYTES + 1)
    with pytest.raises(MotionError, match="huge.bvh"):
        read_bvh(tmp_path / "huge.bvh")
    assert time.process_time() - began < 2


def test_frames_times_joints_and_lines_have_a_bound_that_the_error_names(monkeypatch):
    many = SMALL.replace("Frames: 2", "Frames: 100000") + "1 2 3 0 0 0 0 0 0\n" * 99_998
    monkeypatch.setattr(motion_source, "MOST", 55 * 100)
    with pytest.raises(MotionError, match=r"line 119: 100000 frames of 2 joints; at most 100 are read: cut it"):
        dances.read_text(many)
    with pytest.raises(MotionError, match=r"line 19: a line of more than 1048576 characters"):
        dances.read_text(SMALL.replace("1 2 3", "1 " * 600_000, 1))


def test_what_another_tool_writes_is_the_motion_again(skeleton, dance):
    source = dances.read_text(dances.bvh_text(skeleton, dance, unit=100, order="YXZ"))
    order = [source.names.index(name) for name in skeleton.names]
    np.testing.assert_allclose(source.places[:, order] / 100, skeleton.posed(dance.rotation, dance.transl), atol=1e-6)
