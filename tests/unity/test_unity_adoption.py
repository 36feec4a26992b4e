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
