"""What a studio does with the package: its scenes show the people of the project."""

import numpy as np
import pytest

pytestmark = pytest.mark.slow


def test_a_scene_that_names_nobody_shows_the_people_of_the_project_edited_played_and_built(play, files):
    lines = play("cast", files / "figure.gsac").splitlines()
    assert lines[0].startswith("standing 0 ") and "avatar.gsac" in lines[0], "says what to do where the project has nobody"
    assert lines[1:3] == ["edited 1 DontSave", "played 5 0 draws 5"]
    places = np.array([line.split()[1:] for line in lines[3:8]], float)
    np.testing.assert_allclose(places, [[-1.2, 0, 0], [0, 0, 0], [1.2, 0, 0], [-1.2, 0, -1.2], [0, 0, -1.2]], atol=1e-6)
    assert lines[8:] == ["named 0", "named 1"], "players know their people, scenes in the project stay as they are"


def test_a_file_is_loaded_without_a_halt_may_be_stopped_and_leaves_nothing_where_it_fails(play, files, tmp_path):
    broken = tmp_path / "cut.gsac"
    broken.write_bytes((files / "figure.gsac").read_bytes()[:1000])
    lines = play("load", files / "figure.gsac", broken).splitlines()
    assert lines[:2] == ["at once False", "figure frames True uploads True"], "a buffer or two a frame, all on the main thread"
    assert lines[2:6] == ["draws 1 before True", "buffers 0", "stopped True buffers 0", "play mode ended True buffers 0"]
    assert lines[6].startswith(f"GsacException {broken}: ") and "truncated" in lines[6]
    assert lines[7].startswith("FileNotFoundException ") and "cut.gsac.none" in lines[7]
