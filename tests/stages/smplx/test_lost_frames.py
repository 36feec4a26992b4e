"""Frames that the fit got wrong are named with their reason and count for nothing; all others are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.body import LOST, Body, BodyParams
from gsac.stages.contract import BadInput
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.lost_frames import describe_lost_frames, find_lost_frames, is_mostly_loose, notes_that_hold, refuse_lost
from gsac.stages.smplx.state import Fit

HEIGHT = 1000.0


@pytest.fixture
def good() -> Fit:
    return Fit(None, np.full((10, 55), 0.01), np.full(10, 0.88), np.full(10, 6.0), 20)


def said(fit: Fit, seen: np.ndarray | None = None, own: np.ndarray | None = None,
         beside: np.ndarray | None = None) -> tuple[np.ndarray, list[str]]:
    lost = find_lost_frames(fit, np.ones(10, bool) if seen is None else seen, HEIGHT, np.ones(10, bool) if own is None else own)
    assert np.sum(list(lost.values()), axis=0).max() <= 1  # one reason a frame
    return np.any(list(lost.values()), axis=0), [finding.message for finding in describe_lost_frames(
        lost, fit, np.zeros(10, bool) if beside is None else beside)]


def test_a_good_fit_loses_nothing_and_says_nothing(good):
    lost, words = said(good)
    assert not lost.any() and words == []


def test_one_badly_covered_frame_is_lost_and_named(good):
    iou = good.iou.copy()
    iou[7] = 0.4
    lost, words = said(replace(good, iou=iou))
    assert np.flatnonzero(lost).tolist() == [7]
    assert len(words) == 1 and "frame 7; the body covers the silhouette badly" in words[0]


def test_a_body_off_its_points_is_lost_with_another_reason(good):
    off = good.reprojection.copy()
    off[2:4] = 80
    lost, words = said(replace(good, reprojection=off))
    assert np.flatnonzero(lost).tolist() == [2, 3]
    assert "2 of 10 frames (2-3)" in words[0] and "off the seen points" in words[0]


def test_a_clip_without_a_fitted_frame_is_refused_by_its_reasons(good):
    off = good.reprojection.copy()
    off[2:] = 80
    lost = find_lost_frames(replace(good, reprojection=off), np.arange(10) > 1, HEIGHT, np.ones(10, bool))
    with pytest.raises(BadInput, match=r"none of the clip's 10 frames: no person is seen in 2; .* in 8; film one whole person"):
        refuse_lost(lost)


def test_a_clip_with_one_fitted_frame_is_not_refused(good):
    refuse_lost(find_lost_frames(good, np.arange(10) == 4, HEIGHT, np.ones(10, bool)))


def test_frames_without_a_person_are_lost_whatever_their_numbers(good):
    seen = np.ones(10, bool)
    seen[0] = False
    iou = good.iou.copy()
    iou[0] = np.nan
    lost, words = said(replace(good, iou=iou, reprojection=np.where(seen, 6, np.nan)), seen)
    assert np.flatnonzero(lost).tolist() == [0] and "no person is seen" in words[0]


def test_frames_that_repeat_others_are_lost_without_a_word_for_split_has_named_them(good):
    own = np.ones(10, bool)
    own[3:6] = False
    lost, words = said(good, own, own)
    assert np.flatnonzero(lost).tolist() == [3, 4, 5] and words == []


def test_wide_clothes_in_every_frame_are_told_but_nothing_is_lost(good):
    lost, words = said(replace(good, iou=np.full(10, 0.6)))
    assert not lost.any()
    assert len(words) == 1 and "wide clothes" in words[0] and "all 10 frames" in words[0]


def test_pictures_that_mix_several_moments_of_a_fast_turn_are_named(good):
    iou = good.iou.copy()
    iou[[2, 5]] = 0.8
    assert said(replace(good, iou=iou))[1] == [], "single ones are no news"
    iou[[6, 9]] = 0.85
    lost, words = said(replace(good, iou=iou))
    assert not lost.any() and len(words) == 1 and "4 of 10 frames (2, 5-6, 9)" in words[0] and "turn slower" in words[0]


def test_a_part_of_the_mask_beside_the_body_is_named_where_two_frames_show_one(good):
    uncovered = np.zeros(10)
    uncovered[4] = 0.005
    assert said(replace(good, uncovered=uncovered))[1] == [], "a single one is no news"
    uncovered[8] = 0.004
    lost, words = said(replace(good, uncovered=uncovered))
    assert not lost.any() and len(words) == 1 and "IoU down to 0.88" in words[0] and "2 of 10 frames (4, 8)" in words[0]


@pytest.mark.parametrize("low, mostly", [(5, False), (6, True)])
def test_pictures_mostly_covered_badly_do_not_tell_where_an_arm_is(low, mostly):
    iou = np.full(12, np.nan)
    iou[:10] = 0.92
    iou[:low] = 0.84
    assert is_mostly_loose(iou) is mostly and not is_mostly_loose(np.full(3, np.nan))


def test_the_mark_is_read_back_from_the_joints_spread():
    body = Body.load()
    still = np.zeros((3, 52))
    params = BodyParams.from_pose(np.zeros((3, 55, 3)), np.zeros((3, 3)), np.zeros(body.num_betas), still, 500.0, (1, 1))
    params.sigma_joints[:] = 0.1
    params.sigma_joints[1] = LOST
    assert params.lost.tolist() == [False, True, False]


def test_where_the_mask_lies_beside_the_person_no_clothes_are_blamed(good):
    beside = np.arange(10) < 4
    assert said(replace(good, iou=np.where(beside, 0.75, 0.95)), beside=beside)[1] == []
    assert "wide clothes" in said(replace(good, iou=np.full(10, 0.75)), beside=beside)[1][0]
    clothes, focal = Finding.of(Code.CLOTHES_HIDE_SHAPE, figure=5.0), Finding.of(Code.TURNED_OVER, beside)
    assert notes_that_hold([clothes, focal], beside, np.ones(10, bool)) == [clothes, focal]
    assert notes_that_hold([clothes, focal], beside, np.arange(10) < 7) == [focal], "of most masks the person lies beside"
