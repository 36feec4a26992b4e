"""The first look tells from key points how large a person is and from which sides they were seen."""

import numpy as np
import pytest

from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.stages.first_look import FirstLook


def points(yaws, unseen=()) -> dict[str, np.ndarray]:
    """keypoints.npz's arrays of a person 450 px from eyes to ankles at these yaws (T,), degrees."""
    count, turn = len(yaws), np.radians(yaws)
    xy, world = np.zeros((count, 133, 2)), np.full((count, 133, 3), np.nan)
    xy[:, INDEX["left_ankle"], 1] = 450
    xy[:, FACE.stop - 1, 1] = 60
    for side, sign in (("left", 1), ("right", -1)):
        xy[:, HANDS[side].stop - 1, 0] = 70
        for part in ("shoulder", "hip"):
            world[:, INDEX[f"{side}_{part}"]] = sign * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    score = np.ones((count, 133))
    score[list(unseen)] = 0
    return {"xy": xy, "score": score, "world": world}


@pytest.mark.parametrize(("last", "seen"), [(350, 350), (170, 170), (0, 0)])
def test_the_turn_is_as_wide_as_the_yaws_that_were_seen(last, seen):
    assert FirstLook.of(points(np.linspace(0, last, 36))).turn == pytest.approx(seen, abs=1e-6)


def test_sizes_and_frames_are_told_in_one_line():
    look = FirstLook.of(points(np.linspace(0, 350, 36), unseen=(34, 35)))
    assert look.sentence == ("A person in 34 of 36 frames, 500 px tall, seen from 330 of 360 degrees; face 60 px, hands 70 px.")


def test_a_clip_of_one_frame_is_told_as_that():
    assert FirstLook.of(points([0])).sentence.startswith("A person in the only frame, 500 px tall")


def test_a_part_that_was_never_seen_is_named_as_that():
    arrays = points([0, 10])
    arrays["score"][:, FACE] = 0
    assert "in all 2 frames" in FirstLook.of(arrays).sentence and "no face, hands 70 px" in FirstLook.of(arrays).sentence
