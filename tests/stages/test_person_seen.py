"""A person is told from what only looks like a part of one."""

import numpy as np

from gsac.stages.person_seen import find_seen


def test_a_frame_whose_only_points_are_hands_that_were_filled_shows_nobody():
    score, filled = np.zeros((3, 133)), np.zeros((3, 133), bool)
    score[0, :6] = score[1:, 7:11] = 0.5
    filled[1, 7:11] = filled[2, 9:11] = True
    assert find_seen(score, filled).tolist() == [True, False, True]
