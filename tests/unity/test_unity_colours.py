"""A project with linear colours shows the trained picture, which was composited in display colours; on a software GPU."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.benchmarks.unity import colours

pytestmark = pytest.mark.slow

SIZE = 192
BACKGROUND = .5


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
        if stage.programs.behind:
            assert colours.decibels(stage.lay(shot, background, known=True), want, person) > 45
    print(f"not knowing what lies behind: {min(unknown):.1f} dB; as one draw: {min(direct):.1f} dB")
    assert min(unknown) > 40 and min(unknown) > min(direct) + 3


def test_what_stands_before_the_person_hides_her_and_what_stands_behind_does_not(stage, shot):
    seen = stage.lay(shot, BACKGROUND, known=False)
    near, away = .01, shot.vertices[:, 2]
    depth = lambda metres: 1 - 2 * near / metres  # noqa: E731, of the tests' projection
    hidden = stage.lay(shot, BACKGROUND, known=False, far=depth(away.min() - .2))
    shown = stage.lay(shot, BACKGROUND, known=False, far=depth(away.max() + .2))
    assert abs(seen - BACKGROUND).max() > .2
    np.testing.assert_allclose(hidden, BACKGROUND, atol=1e-3)
    np.testing.assert_array_equal(shown, seen)
