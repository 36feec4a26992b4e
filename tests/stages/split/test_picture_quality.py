"""split judges a clip by its pictures: what repeats, breaks off, changes its light or is blurred is named, and nothing else is."""

import json

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import Clip
from gsac.stages.findings import Code
from gsac.stages.split.picture_quality import judge_pictures, look_at

HEIGHT, WIDTH, FRAMES = 240, 160, 24


def room(seed: int) -> np.ndarray:
    """(H, W, 3) uint8, sharp boxes of many colours."""
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(40, 180, (24, 16, 3), np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST)


def film(step: float = 3.0, frames: int = FRAMES) -> list[np.ndarray]:
    """A dark bar that moves by `step` px a frame before a room, with noise."""
    pictures = []
    for t in range(frames):
        picture, x = room(1).astype(np.float32), round(20 + step * t)
        picture[40:220, x:x + 16] = (20, 30, 90)
        pictures.append(np.clip(picture + np.random.default_rng(t).normal(0, 1, picture.shape), 0, 255).astype(np.uint8))
    return pictures


def judge(pictures, timed=True, find_shown=None):
    repeated, findings = judge_pictures([look_at(picture) for picture in pictures], timed, find_shown)
    return np.flatnonzero(repeated).tolist(), {finding.code: finding for finding in findings}


def again(pictures, *places):
    """The film where these places show the last picture before them, with noise of their own."""
    shown = list(pictures)
    for t in places:
        first = next(p for p in range(t, -1, -1) if p not in places)
        noise = np.random.default_rng(100 + t).normal(0, 1, shown[t].shape)
        shown[t] = np.clip(np.round(shown[first] + noise), 0, 255).astype(np.uint8)
    return shown


def test_a_good_clip_is_told_nothing():
    assert judge(film()) == ([], {})


def test_a_picture_that_stands_still_is_used_once_and_its_frames_are_named():
    repeated, found = judge(again(film(), *range(8, 16)))
    assert repeated == list(range(8, 16))
    assert found.keys() == {Code.FROZEN} and found[Code.FROZEN].frames == [[8, 15]] and found[Code.FROZEN].figure == 8
    assert "Unless you held still there" in found[Code.FROZEN].message, "a pause cannot be told from somebody who holds still"


def test_a_picture_that_repeats_now_and_then_is_left_out_and_no_news():
    assert judge(again(film(), 5, 17)) == ([5, 17], {})


def test_a_clip_whose_every_second_picture_repeats_says_so():
    repeated, found = judge(again(film(), *range(1, FRAMES, 2)))
    assert repeated == list(range(1, FRAMES, 2)) and found.keys() == {Code.REPEATED}


def test_slow_motion_repeats_nothing_for_long():
    repeated, found = judge(film(step=0.5, frames=60))
    assert len(repeated) <= 30 and Code.FROZEN not in found


def test_among_photos_nothing_repeats():
    assert judge(again(film(), 4, 5, 6, 7), timed=False) == judge(film(0), timed=False) == ([], {})


def test_a_clip_in_which_nothing_moves_says_so_and_keeps_its_frames():
    repeated, found = judge(film(0))
    assert repeated == [] and found.keys() == {Code.NOTHING_MOVES} and "all 24 frames" in found[Code.NOTHING_MOVES].message
    assert judge(film(0, frames=3)) == ([], {})


def test_another_scene_is_named_by_its_first_frame_and_a_flash_is_none():
    other = [np.ascontiguousarray(255 - room(9)) + np.uint8(t) for t in range(8)]
    assert judge(film()[:16] + other)[1][Code.SCENE_CUT].frames == [[16, 16]]
    flash = film()
    flash[9] = np.full_like(flash[9], 250)
    assert Code.SCENE_CUT not in judge(flash)[1]


@pytest.mark.parametrize("gain", [(1.4, 1.4, 1.4), (0.8, 1.0, 1.15)])
def test_frames_of_another_exposure_or_white_balance_are_named(gain):
    pictures = [np.clip(p * np.array(gain), 0, 255).astype(np.uint8) if t >= 14 else p for t, p in enumerate(film())]
    found = judge(pictures)[1]
    assert found.keys() == {Code.EXPOSURE_STEPS} and found[Code.EXPOSURE_STEPS].frames == [[14, 23]]
    assert found[Code.EXPOSURE_STEPS].figure == pytest.approx(max(abs(np.log(gain))), abs=0.12)


def test_a_blurred_clip_and_a_few_frames_that_moved_sideways_are_named():
    soft = [cv2.GaussianBlur(p, (0, 0), 2.5) for p in film()]
    assert judge(soft)[1][Code.BLURRED].frames == [[0, 23]]
    shaken = [cv2.blur(p, (9, 1)) if 5 <= t < 8 else p for t, p in enumerate(film())]
    assert judge(shaken)[1][Code.BLURRED].frames == [[5, 7]]


def test_an_empty_room_is_not_said_to_stand_still_or_to_be_blurred_and_somebody_is_looked_for_only_in_doubt():
    nobody, asked = np.arange(FRAMES) < 8, []

    def find_shown(frames):
        asked.append(np.flatnonzero(frames).tolist())
        return frames & ~nobody

    empty = again([np.zeros_like(film()[0])] + [cv2.GaussianBlur(room(1), (0, 0), 2.5)] * 7, *range(2, 8))
    repeated, found = judge([*empty, *film()[8:]], find_shown=find_shown)
    assert repeated == list(range(2, 8)) and not found.keys() & {Code.FROZEN, Code.BLURRED, Code.REPEATED}
    repeated, found = judge([*empty, *again(film(), *range(12, 16))[8:]], find_shown=find_shown)
    assert found[Code.FROZEN].frames == [[12, 15]] and repeated[-4:] == list(range(12, 16))
    assert len(asked) == 2 and not {*range(16, FRAMES)} & {*asked[0], *asked[1]}
    assert judge(film(), find_shown=find_shown) == ([], {}) and len(asked) == 2
    soft = [cv2.GaussianBlur(p, (0, 0), 2.5) for p in film()]
    assert judge(soft, find_shown=pytest.fail)[1][Code.BLURRED].frames == [[0, 23]]


def test_a_plain_picture_is_not_called_blurred():
    assert judge([np.full((HEIGHT, WIDTH, 3), 90, np.uint8)] * 6)[1].keys() == {Code.NOTHING_MOVES}


def test_clip_json_lists_repeated_frames_and_says_nothing_where_there_are_none(tmp_path):
    clip = Clip(10.0, [0.0, 0.1, 0.2], 4, 4, None, "")
    clip.write(tmp_path / "clip.json")
    assert "repeated" not in json.loads((tmp_path / "clip.json").read_text())
    clip.repeated = [1]
    clip.write(tmp_path / "clip.json")
    assert Clip.read(tmp_path / "clip.json").shows_own_moment(3).tolist() == [True, False, True]
