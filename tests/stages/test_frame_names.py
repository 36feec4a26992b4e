import numpy as np

from gsac.stages.frame_names import name_frames


def test_long_lists_of_frames_are_cut():
    assert name_frames(np.arange(5) == 3) == "frame 3"
    assert name_frames(np.isin(np.arange(50), [1, 2, 3, 7])) == "4 of 50 frames (1-3, 7)"
    assert name_frames(np.ones(50, bool)) == "all 50 frames" and name_frames(np.ones(1, bool)) == "the only frame"
    assert name_frames(np.arange(50) % 2 == 0).endswith("12, 14, ...)")
