"""Frames that were not trained on: they follow the trained ones, and their own fit as far as it has proved right."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.stages.train.poses.interpolate import follow_neighbours

FRAMES = 40
UNTRAINED = [5, 12, 13, 20, 27, 34]


@pytest.fixture
def turn():
    """A smooth turn through half a turn and more: pose (T, J, 3), transl (T, 3), trained (T,)."""
    time = np.arange(FRAMES)[:, None]
    orient, arm, leg = np.radians(6 * time - 60) * [0, 1, 0], 0.4 * np.sin(time / 6 + [0, 1, 2]), 0.2 * np.cos(time / 9 + [2, 0, 1])
    pose = np.stack([orient, arm, leg], 1)
    trained = np.ones(FRAMES, bool)
    trained[UNTRAINED] = False
    return rotation.log(rotation.exp(np.array([np.pi, 0, 0])) @ rotation.exp(pose)), 0.1 * np.sin(time / 8 + [0, 2, 4]), trained


def shaken(pose, transl, angle, seed=0):
    rng = np.random.default_rng(seed)
    turns = rotation.exp(pose) @ rotation.exp(rng.normal(0, angle, pose.shape))
    return rotation.log(turns), transl + rng.normal(0, angle, transl.shape)


def off(pose, transl, true_pose, true_transl, frames):
    turns = rotation.log(rotation.exp(pose[frames]).swapaxes(-1, -2) @ rotation.exp(true_pose[frames]))
    return np.linalg.norm(turns, axis=-1).max(), np.abs(transl[frames] - true_transl[frames]).max()


def test_between_frames_that_move_smoothly_a_frame_does_so_too_however_its_fit_shakes(turn):
    pose, transl, trained = turn
    fit, fit_transl = shaken(pose, transl, 0.05)
    begun = np.where(trained[:, None, None], pose, fit), np.where(trained[:, None], transl, fit_transl)
    assert max(off(*begun, pose, transl, UNTRAINED)) > 0.08
    assert max(off(*follow_neighbours(fit, fit_transl, *begun, trained), pose, transl, UNTRAINED)) < 0.02


def test_what_the_fit_rightly_sees_in_a_frame_alone_is_believed(turn):
    pose, transl, trained = turn
    true, true_transl = shaken(pose, transl, 0.1)
    fit, fit_transl = shaken(true, true_transl, 0.005, seed=1)
    refined = np.where(trained[:, None, None], true, pose), np.where(trained[:, None], true_transl, transl)
    assert max(off(*follow_neighbours(fit, fit_transl, *refined, trained), true, true_transl, UNTRAINED)) < 0.05


def test_a_fit_that_was_left_as_it_is_stays(turn):
    pose, transl, trained = turn
    fit = shaken(pose, transl, 0.05)
    assert max(off(*follow_neighbours(*fit, *fit, trained), *fit, range(FRAMES))) < 1e-9


@pytest.mark.parametrize("t", [1, 38])
def test_next_to_the_clips_end_one_neighbour_is_enough_on_that_side(turn, t):
    pose, transl, trained = turn
    trained[:] = True
    trained[t] = False
    fit, fit_transl = shaken(pose, transl, 0.05)
    begun = np.where(trained[:, None, None], pose, fit), np.where(trained[:, None], transl, fit_transl)
    assert max(off(*begun, pose, transl, [t])) > 0.05
    assert max(off(*follow_neighbours(fit, fit_transl, *begun, trained), pose, transl, [t])) < 0.02


def test_frames_without_near_neighbours_on_both_sides_stay_as_they_are(turn):
    pose, transl, trained = turn
    fit, fit_transl = shaken(pose, transl, 0.05)
    trained[[0, 1, 20, 21, 22, 23]] = False
    trained[39] = False
    for t in (0, 1, 20, 23, 39):
        got, shift = follow_neighbours(fit, fit_transl, pose, transl, trained)
        np.testing.assert_array_equal(got[t], pose[t])
        np.testing.assert_array_equal(shift[t], transl[t])
    far = pose.copy()
    far[:, 0] = rotation.log(rotation.exp(np.array([0, 1.0, 0]) * np.arange(FRAMES)[:, None]))
    np.testing.assert_array_equal(follow_neighbours(far, transl, far, transl + 1, trained)[1], transl + 1)
    np.testing.assert_array_equal(follow_neighbours(fit[:9], fit_transl[:9], pose[:9], transl[:9], trained[:9])[0], pose[:9])
