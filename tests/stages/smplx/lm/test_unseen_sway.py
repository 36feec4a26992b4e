"""Legs of who sways while stepping on the spot are said to be doubtful along the view; nobody else's are."""

import numpy as np
import pytest

from gsac.avatar.joints import INDEX
from gsac.avatar.rotation import about_y
from gsac.stages.findings import Code
from gsac.stages.smplx.lm.unseen_sway import LEAST, find_unseen_sway, measure_missing_sway

FRAMES = 40


def person(across: float, along: float) -> np.ndarray:
    """Joints (T, 55, 3) m of one whose hips sway over the feet by so many m, standard deviation."""
    joints = np.zeros((FRAMES, 55, 3))
    phase = np.linspace(0, 6 * np.pi, FRAMES, endpoint=False)
    joints[:, INDEX["pelvis"]] = np.stack([across * 2**0.5 * np.sin(phase), np.full(FRAMES, -0.9),
                                           along * 2**0.5 * np.cos(phase)], 1)
    return joints + [0.1, 0.5, 3.0]


def turned(degrees: float) -> np.ndarray:
    return np.stack([about_y(angle) for angle in np.radians(np.linspace(0, degrees, FRAMES))])


def test_what_is_missing_along_the_view_is_measured_against_the_sway_across():
    assert measure_missing_sway(person(0.10, 0.06)) == pytest.approx(0.08)
    assert measure_missing_sway(person(0.06, 0.10)) == 0


def test_legs_of_who_sways_across_the_picture_alone_are_doubtful_in_all_frames():
    (found,) = find_unseen_sway(turned(350), person(0.10, 0.06))
    assert found.code is Code.LEGS_DOUBTFUL and found.frames == [[0, FRAMES - 1]]
    assert "may be off by 16 cm in all 40 frames" in found.message


@pytest.mark.parametrize("across, along", [(0.02, 0.01), (0.06, 0.06), (0.03, 0.10), (LEAST, 0.01)])
def test_who_stands_still_or_is_seen_to_sway_to_all_sides_is_trusted(across, along):
    assert find_unseen_sway(turned(350), person(across, along)) == []


def test_a_frame_that_lies_on_its_side_says_nothing_of_the_others():
    joints = person(0.02, 0.01)
    joints[7, INDEX["pelvis"]] = joints[7, INDEX["left_ankle"]] + [-0.84, -0.04, 0]
    assert measure_missing_sway(joints) == pytest.approx(measure_missing_sway(person(0.02, 0.01)), abs=2e-3)
    assert find_unseen_sway(turned(350), joints) == []


def test_nothing_is_concluded_of_who_does_not_turn():
    assert find_unseen_sway(turned(120), person(0.10, 0.02)) == []
