"""Choice of frames, and the words of bad parameters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsac.avatar.artifacts import ArtifactError, Clip
from gsac.stages.contract import BadInput, make_config
from gsac.stages.split import STAGE
from gsac.stages.split.check import check_clip
from gsac.stages.split.pick import fit_size, pick_by_time

steps = st.lists(st.floats(1e-3, 0.5), min_size=0, max_size=60)


@given(steps, st.one_of(st.none(), st.floats(0.5, 60)), st.one_of(st.none(), st.integers(1, 40)))
def test_picks_are_rising_unique_within_count_and_start_at_the_first(gaps, fps, count):
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    picks = pick_by_time(times, fps, count)
    assert picks[0] == 0 and (np.diff(picks) > 0).all() and picks[-1] < len(times)
    assert count is None or len(picks) <= count
    if fps is None and count is None:
        assert len(picks) == len(times)


def test_a_variable_rate_is_sampled_evenly_in_time_not_in_frames():
    times = np.concatenate([np.arange(0, 1, 0.01), np.arange(1, 3.05, 0.1)])
    kept = times[pick_by_time(times, 10, None)]
    assert np.diff(kept) == pytest.approx(0.1, abs=1e-6)


def test_a_tall_frame_is_scaled_with_its_aspect():
    assert fit_size(2160, 3840, 1280) == (720, 1280)
    assert fit_size(1920, 1080, 1280) == (1920, 1080)


@pytest.mark.parametrize(("values", "name"), [({"fps": 0}, "split.fps"), ({"count": 0}, "split.count"),
                                              ({"max_height": 3}, "split.max_height"), ({"speed": 1}, "split.speed")])
def test_a_bad_parameter_is_named(values, name):
    with pytest.raises(BadInput, match=name):
        make_config(STAGE, values)


@pytest.mark.parametrize("times", [[], [0.0, 0.0], [1.0, 0.5]])
def test_timestamps_that_do_not_rise_are_refused(tmp_path, times):
    clip = Clip(30.0, times, 4, 4, None, "0")
    clip.write(tmp_path / "clip.json")
    with pytest.raises(ArtifactError, match="timestamps_s"):
        check_clip(tmp_path / "clip.json")
