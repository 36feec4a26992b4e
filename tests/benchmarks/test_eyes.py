"""The bench of other body networks, on made-up points."""

import numpy as np

from gsac.avatar.artifacts import read_arrays, write_arrays
from gsac.avatar.body import Body
from gsac.benchmarks import eyes
from gsac.stages.smplx.detector_errors import Detector, read_errors


def test_true_places_are_put_only_where_a_point_was_seen(tmp_path):
    xy, score = np.zeros((2, 133, 2), np.float32), np.ones((2, 133), np.float32)
    score[0, 7] = 0
    write_arrays(tmp_path / "seen.npz", xy=xy, score=score)
    true = np.full((2, 23, 2), 5.0)
    true[1, 9] = np.nan
    got = read_arrays(eyes.put_in_place(tmp_path / "seen.npz", true, tmp_path / "true.npz"))
    assert not got["xy"][0, 7].any() and not got["xy"][1, 9].any() and not got["xy"][:, 23:].any()
    assert (got["xy"][:, :7] == 5).all() and (got["score"] == score).all()


def test_points_without_errors_weigh_what_the_embedded_network_s_weigh(tmp_path):
    path = eyes.forget_errors(tmp_path / "none.npz")
    read_errors(path)
    body = Body.load()
    none, known = Detector.load(path, body), Detector.load("mediapipe", body)
    assert not none.offsets[:23].any() and not none.habit[:23].any() and not none.own[:23].any()
    assert np.array_equal(none.spread, known.spread) and np.array_equal(none.offsets[23:], known.offsets[23:])
