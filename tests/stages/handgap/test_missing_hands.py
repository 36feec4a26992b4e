"""Missing and misplaced hands are found; hands that are right are let be."""

import numpy as np
import pytest

from gsac.avatar.wholebody import ARM, HANDS

LEFT, RIGHT = 0, 1


@pytest.mark.parametrize("clip", [
    {}, {"arm_angle": 1.4}, {"arm_angle": 0.05}, {"fps": 30, "frames": 200, "turns": 0.33},
    {"fps": 5, "frames": 50, "turns": 2}, {"swing": 0.5}, {"swing": 0.8, "arm_angle": 0.8}, {"noise": 6},
])
def test_no_false_alarm_on_hands_that_are_right(synthetic, tmp_path, clip):
    for seed in range(3):
        out, warnings = synthetic.through_stage(synthetic.turning(seed=seed, **clip), tmp_path / str(seed))
        assert not out["missing"].any() and not out["filled"].any() and not warnings


@pytest.mark.parametrize("side", [LEFT, RIGHT])
@pytest.mark.parametrize("length", [1, 3, 8, 14])
@pytest.mark.parametrize("wrist", [True, False])
def test_a_hand_on_the_other_hands_place_is_missing_and_the_other_is_not(synthetic, tmp_path, side, length, wrist):
    person = synthetic.turning(seed=3, start=0.6)
    synthetic.put_on_other(person, ("left", "right")[side], 40, 40 + length, wrist=wrist)
    out, warnings = synthetic.through_stage(person, tmp_path)
    assert out["missing"][40: 40 + length, side].all()
    assert out["missing"].sum() == length
    assert "wrong place" in warnings[0] and "40" in warnings[0]


def test_misplaced_hands_are_found_over_many_views(synthetic, tmp_path):
    found = wrong = 0
    for seed in range(10):
        person = synthetic.turning(seed=seed, start=seed * 0.7)
        first = 20 + 5 * seed
        synthetic.put_on_other(person, "left", first, first + 6)
        out, _ = synthetic.through_stage(person, tmp_path / str(seed))
        far = np.linalg.norm(person.xy - person.truth, axis=2)[:, 91:112].mean(axis=1) > 20
        found += out["missing"][far, LEFT].mean()
        wrong += out["missing"][:, RIGHT].sum()
    assert found / 10 >= 0.95 and wrong == 0


def test_a_misplacement_at_the_clips_start_is_found_from_behind(synthetic, tmp_path):
    person = synthetic.put_on_other(synthetic.turning(), "right", 0, 5)
    out, _ = synthetic.through_stage(person, tmp_path)
    assert out["missing"][:5, RIGHT].all() and out["missing"].sum() == 5


def test_swapped_hands_are_both_missing(synthetic, tmp_path):
    person = synthetic.turning()
    left = person.xy[50:53, 91:112].copy()
    person.xy[50:53, 91:112] = person.xy[50:53, 112:133]
    person.xy[50:53, 112:133] = left
    out, _ = synthetic.through_stage(person, tmp_path)
    assert out["missing"][50:53].all() and out["missing"].sum() == 6


def test_a_hand_thrown_far_off_for_a_frame_is_missing(synthetic, tmp_path):
    person = synthetic.turning(fps=30)
    person.xy[60, [9, *range(91, 112)]] += [0, -150]
    out, _ = synthetic.through_stage(person, tmp_path)
    assert np.argwhere(out["missing"]).tolist() == [[60, LEFT]]


def test_an_impossibly_long_hand_is_missing(synthetic, tmp_path):
    person = synthetic.turning()
    root = person.xy[30, 91]
    person.xy[30, 91:112] = root + 5 * (person.xy[30, 91:112] - root)
    out, _ = synthetic.through_stage(person, tmp_path)
    assert np.argwhere(out["missing"]).tolist() == [[30, LEFT]]


def test_a_single_seen_frame_inside_a_long_gap_is_not_believed(synthetic, tmp_path):
    person = synthetic.turning()
    for first, last in ((30, 35), (36, 41), (60, 61)):
        synthetic.lose(person, "left", first, last)
    out, _ = synthetic.through_stage(person, tmp_path)
    assert np.flatnonzero(out["missing"][:, LEFT]).tolist() == [*range(30, 41), 60]


def test_a_score_between_the_two_thresholds_neither_loses_nor_returns_a_hand(synthetic, tmp_path):
    person = synthetic.turning()
    person.score[20:40, 91:112] = 0.4
    person.score[60:70, 91:112] = 0.1
    person.score[70:75, 91:112] = 0.4
    out, _ = synthetic.through_stage(person, tmp_path)
    assert np.flatnonzero(out["missing"][:, LEFT]).tolist() == list(range(60, 75))


def test_hands_never_detected_give_no_points_and_no_second_warning(synthetic, tmp_path):
    person = synthetic.lose(synthetic.turning(), "left", 0, 100)
    out, warnings = synthetic.through_stage(person, tmp_path)
    assert out["missing"][:, LEFT].all() and not out["filled"].any() and (out["score"][:, 91:112] == 0).all()
    assert not warnings, "keypoints has said so"


def test_a_hand_whose_every_detection_is_too_weak_gives_a_warning(synthetic, tmp_path):
    person = synthetic.turning()
    person.score[:, HANDS["left"]] = 0.1
    out, warnings = synthetic.through_stage(person, tmp_path)
    assert out["missing"][:, LEFT].all()
    assert warnings[0] == "The left hand was never seen well enough; its pose is a guess. Show both hands, fingers apart."


def test_points_that_are_not_numbers_count_as_unseen(synthetic, tmp_path):
    person = synthetic.turning()
    person.xy[40:44, 112:133] = np.nan
    out, _ = synthetic.through_stage(person, tmp_path)
    assert np.flatnonzero(out["missing"][:, RIGHT]).tolist() == [40, 41, 42, 43]
    assert np.isfinite(out["xy"]).all() and np.isfinite(out["sigma"]).all()


@pytest.mark.parametrize("frames", [1, 2])
def test_one_and_two_frames_pass(synthetic, tmp_path, frames):
    out, _ = synthetic.through_stage(synthetic.turning(frames=frames), tmp_path)
    assert not out["missing"].any()


def test_photos_are_never_filled(synthetic, tmp_path):
    person = synthetic.turning(frames=7, turns=14)
    synthetic.lose(person, "left", 2, 3)
    person.xy[4, 112:133] = person.xy[4, 91:112]
    out, _ = synthetic.through_stage(person, tmp_path, photos=True)
    assert np.argwhere(out["missing"]).tolist() == [[2, LEFT], [4, RIGHT]]
    assert not out["filled"].any() and (out["score"][2, 91:112] == 0).all() and (out["score"][4, 112:133] == 0).all()


def test_the_papers_rule_goes_by_the_scores_of_wrist_and_palm_and_fills_the_elbow_too(synthetic, tmp_path):
    person = synthetic.lose(synthetic.turning(), "left", 20, 24)
    synthetic.lose(person, "left", 40, 44, wrist=False)
    synthetic.put_on_other(person, "right", 60, 66)
    out, _ = synthetic.through_stage(person, tmp_path, method="paper", rule="paper")
    assert np.flatnonzero(out["missing"][:, LEFT]).tolist() == [20, 21, 22, 23], "its wrist is seen from 40 on: not missing"
    assert not out["missing"][:, RIGHT].any(), "a wrong place with a good score is believed"
    assert out["filled"][20:24, ARM["left"][1]].all(), "the elbow, which was seen, is placed anew"


@pytest.mark.parametrize(("lost", "said"), [(3, 0), (7, 1)])
def test_a_hand_that_few_photos_lack_is_no_news(synthetic, tmp_path, lost, said):
    person = synthetic.lose(synthetic.turning(frames=10), "left", 1, 1 + lost)
    _, warnings = synthetic.through_stage(person, tmp_path, photos=True)
    assert len(warnings) == said
