"""Held-out frames: spaced in yaw, and judged with their neighbours' pose correction."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.stages.contract import BadInput
from gsac.stages.train.choose_heldout import carry_corrections, hold_out, hold_out_for_choosing, hold_out_named
from gsac.stages.train.config import TrainConfig, read_numbers


def turning(yaws):
    upright = Rotation.from_rotvec([np.pi, 0, 0])
    return (upright * Rotation.from_rotvec(np.asarray(yaws)[:, None] * [0.0, -1.0, 0.0])).as_rotvec()


def test_held_out_frames_are_spaced_in_yaw_not_in_time():
    rng = np.random.default_rng(0)
    yaws = rng.permutation(np.linspace(-3, 3, 64))
    held = hold_out(turning(yaws), np.ones(64, bool), 8)
    assert len(held) == 8
    gaps = np.diff(np.sort(yaws[held]))
    np.testing.assert_allclose(gaps, gaps[0])


def test_unusable_frames_are_never_held_out_short_clips_keep_one_and_the_shortest_none():
    orient = turning(np.linspace(-3, 3, 20))
    usable = np.ones(20, bool)
    usable[::2] = False
    assert not set(hold_out(orient, usable, 4)) & set(range(0, 20, 2))
    assert len(hold_out(orient[:7], np.ones(7, bool), 8)) == 1
    assert not len(hold_out(orient[:4], np.ones(4, bool), 8))
    assert not len(hold_out(orient, usable, 0))
    assert not len(hold_out(orient[:1], np.ones(1, bool), 8))


def test_a_correction_shared_by_all_frames_reaches_the_held_out_ones():
    rng = np.random.default_rng(1)
    pose, transl = rng.normal(0, 1, (9, 5, 3)), rng.normal(0, 1, (9, 3))
    pose[:, 0] = turning(np.radians(6 * np.arange(9)))
    turn = Rotation.from_rotvec(rng.normal(0, 0.05, (5, 3)))
    refined = np.stack([(Rotation.from_rotvec(p) * turn).as_rotvec() for p in pose])
    trained = np.ones(9, bool)
    trained[[0, 4, 8]] = False
    given = np.where(trained[:, None, None], refined, pose)
    got, shift = carry_corrections(pose, transl, given, transl + trained[:, None] * [0.1, 0, -0.2], trained)
    for t in range(9):
        left_over = Rotation.from_rotvec(got[t]).inv() * Rotation.from_rotvec(refined[t])
        np.testing.assert_allclose(left_over.magnitude(), 0, atol=1e-9)
    np.testing.assert_allclose(shift, transl + [0.1, 0, -0.2])


def test_views_far_apart_do_not_correct_each_other():
    pose, transl = np.zeros((3, 5, 3)), np.zeros((3, 3))
    pose[:, 0] = turning(np.radians([0, 60, 70]))
    trained = np.array([True, False, True])
    got, shift = carry_corrections(pose, transl, pose, transl + trained[:, None] * [0.1, 0, 0], trained)
    np.testing.assert_allclose(shift[1], [0.05, 0, 0])  # of the near one of its two neighbours alone
    got, shift = carry_corrections(pose[:2], transl[:2], pose[:2], transl[:2] + [[0.1, 0, 0], [0, 0, 0]], trained[:2])
    np.testing.assert_allclose(shift[1], 0)


def test_frames_to_choose_by_are_others_only_where_the_clip_is_long():
    def both(frames, usable=None):
        orient = turning(np.linspace(-3, 3, frames))
        usable = np.ones(frames, bool) if usable is None else usable
        held = hold_out(orient, usable, 8)
        return held, hold_out_for_choosing(orient, usable, held, 8)

    held, choosing = both(60)
    np.testing.assert_array_equal(choosing, held)
    held, choosing = both(90)
    assert len(choosing) == 10 and not set(choosing) & set(held)
    assert np.diff(choosing).max() < 20, "from all sides"
    np.testing.assert_array_equal(*both(90, np.arange(90) < 60))


def test_the_frames_of_a_published_test_are_held_out_as_they_are_named():
    usable = np.ones(12, bool)
    usable[9] = False
    assert hold_out_named(read_numbers("8-11, 2"), usable).tolist() == [2, 8, 10, 11]
    assert read_numbers(7) == [7]


@pytest.mark.parametrize("numbers, what", [("0-11", "leave some"), ("12", "frames 0 to 11")])
def test_named_frames_that_leave_nothing_or_are_not_there_are_refused(numbers, what):
    with pytest.raises(BadInput, match=f"train.heldout_frames.*{what}"):
        hold_out_named(read_numbers(numbers), np.ones(12, bool))


@pytest.mark.parametrize("numbers", ["8-2", "last", "", "3,,4", "0-99999999999"])
def test_a_list_of_frames_that_is_none_is_named(numbers):
    with pytest.raises(BadInput, match="train.heldout_frames has"):
        TrainConfig(heldout_frames=numbers).check()
