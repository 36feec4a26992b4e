"""Peaks of a SimCC network as scores."""

import numpy as np
import pytest

from gsac.avatar.onnx_network import NetworkError
from gsac.stages.keypoints.simcc_scores import calibrate


@pytest.mark.parametrize("peaks", [0.19, 40.0, -2.0, np.nan])
def test_peaks_of_no_known_kind_are_refused(peaks):
    with pytest.raises(NetworkError, match="the file gives peaks whose strongest tenth begins at"):
        calibrate(np.full((3, 133), peaks), "the file")


def test_a_higher_peak_never_scores_lower_and_frames_without_a_person_stay_empty():
    for top in (1.05, 8.0):
        peaks = np.zeros((2, 133))
        peaks[0] = np.linspace(-0.5, top, 133)
        score = calibrate(peaks, "it")
        assert not score[1].any() and score.min() == 0 and score.max() <= 1 and (np.diff(score[0]) >= 0).all()
