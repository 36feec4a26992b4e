"""Gaps are filled near the truth, with a sigma that says how near."""

from typing import get_args

import numpy as np
import pytest

from gsac.avatar.wholebody import ARM, HANDS, PALM
from gsac.stages.contract import BadInput, make_config
from gsac.stages.handgap import STAGE
from gsac.stages.handgap.arm_segments import turn_with_palm
from gsac.stages.handgap.config import Method, Rule
from gsac.stages.handgap.fill import METHODS, fill_gaps
from gsac.stages.handgap.methods import gp, hermite, paper, paper_literal
from gsac.stages.handgap.missing_hands import MissingHands
from gsac.stages.handgap.stage import RULES

SEGMENTWISE = {"paper": paper.interpolate, "hermite": hermite.interpolate, "gp": gp.interpolate}
GOOD = ("turning", *SEGMENTWISE)


def palm_error(synthetic, folder, method, gap, runs=4, **clip):
    """Mean px over the filled frames of arms lost from the elbow on, gap frames between seen ones."""
    errors = []
    for seed in range(runs):
        person = synthetic.turning(seed=seed, start=seed * 1.1, **clip)
        first = 25 + 4 * seed
        inside = slice(first, first + gap - 1)
        synthetic.lose(person, "left", first, first + gap - 1, elbow=True)
        out, _ = synthetic.through_stage(person, folder / f"{method}{gap}_{seed}", method=method, max_gap_s=9)
        assert out["filled"][inside, PALM["left"]].all() and out["filled"][inside, ARM["left"][1]].all()
        error = np.linalg.norm(out["xy"] - person.truth, axis=2)
        errors.append(error[inside, PALM["left"]].mean())
    return np.mean(errors)


@pytest.mark.parametrize("method", GOOD)
@pytest.mark.parametrize(("gap", "limit"), [(2, 6), (4, 7), (8, 9), (16, 15), (32, 32)])
def test_a_lost_arm_is_filled_near_the_truth(synthetic, tmp_path, method, gap, limit):
    assert palm_error(synthetic, tmp_path, method, gap, swing=0.03) < limit


def test_the_default_beats_the_papers_method_where_arms_swing(synthetic, tmp_path):
    default = make_config(STAGE, {}).method
    assert palm_error(synthetic, tmp_path, default, 8) < 0.6 * palm_error(synthetic, tmp_path, "paper", 8)


def test_the_update_as_printed_overshoots(synthetic, tmp_path):
    printed = palm_error(synthetic, tmp_path, "paper-literal", 8, runs=3, swing=0.03)
    consistent = palm_error(synthetic, tmp_path, "paper", 8, runs=3, swing=0.03)
    assert printed > 3 * consistent


@pytest.mark.parametrize("method", SEGMENTWISE)
def test_the_shorter_arc_is_taken_across_plus_minus_pi(method):
    times = np.arange(30) / 10
    angles = np.pi + 0.5 * (times - times[15])
    segment = 80 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    seen = np.ones(30, bool)
    seen[12:19] = False
    filled = SEGMENTWISE[method](segment, seen, 11, 19, times)
    assert np.linalg.norm(filled - segment[12:19], axis=1).max() < 2


def test_the_paper_turns_at_a_constant_rate_with_the_length_of_the_last_seen_frame():
    segment = np.array([[10.0, 0], [0, 0], [0, 0], [0, 20.0]])
    filled = paper.interpolate(segment, np.array([1, 0, 0, 1], bool), 0, 3, np.arange(4) / 10)
    assert filled == pytest.approx(10 * np.array([[np.cos(a), np.sin(a)] for a in np.deg2rad([30, 60])]))


def test_the_printed_update_multiplies_elapsed_frames_onto_the_previous_angle():
    segment = np.array([[10.0, 0], [0, 0], [0, 0], [0, 10.0]])
    filled = paper_literal.interpolate(segment, np.array([1, 0, 0, 1], bool), 0, 3, np.arange(4) / 10)
    assert filled == pytest.approx(10 * np.array([[np.cos(a), np.sin(a)] for a in np.deg2rad([30, 90])]))


def test_uneven_timestamps_set_the_rate():
    times = np.array([0, 0.1, 0.9, 1.0])
    segment = np.array([[10.0, 0], [0, 0], [0, 0], [0, 10.0]])
    filled = paper.interpolate(segment, np.array([1, 0, 0, 1], bool), 0, 3, times)
    assert np.rad2deg(np.arctan2(filled[:, 1], filled[:, 0])) == pytest.approx([9, 81])


def test_the_shoulder_comes_from_the_detection(synthetic, tmp_path):
    person = synthetic.turning(swing=0, turns=0, noise=0)
    synthetic.lose(person, "left", 40, 45, elbow=True)
    person.xy[42] += [30, -10]
    person.truth[42] += [30, -10]
    out, _ = synthetic.through_stage(person, tmp_path)
    assert out["xy"][40:45, PALM["left"]] == pytest.approx(person.truth[40:45, PALM["left"]], abs=1)


def test_a_wrist_that_is_seen_is_kept_and_carries_the_hand(synthetic, tmp_path):
    person = synthetic.turning(noise=0)
    synthetic.lose(person, "right", 40, 46, wrist=False)
    out, _ = synthetic.through_stage(person, tmp_path)
    wrist = ARM["right"][2]
    assert not out["filled"][:, wrist].any() and np.array_equal(out["xy"][:, wrist], person.xy[:, wrist].astype("f4"))
    error = np.linalg.norm(out["xy"] - person.truth, axis=2)[40:46, HANDS["right"]]
    assert out["filled"][40:46, HANDS["right"]].all() and error.max() < 6


def test_fingers_turn_and_scale_with_the_palm():
    points = np.array([[10.0, 0], [10, 5], [20, -5]])
    turned = turn_with_palm(points, np.array([10.0, 0]), np.array([0, 15.0]))
    assert turned == pytest.approx(1.5 * np.array([[0, 10.0], [-5, 10], [5, 20]]))
    assert turn_with_palm(points, np.array([0.1, 0]), np.array([0, 15.0])) == pytest.approx(points)


def test_both_hands_at_once(synthetic, tmp_path):
    person = synthetic.turning(swing=0.03)
    for side in ("left", "right"):
        synthetic.lose(person, side, 50, 56)
    out, _ = synthetic.through_stage(person, tmp_path)
    error = np.linalg.norm(out["xy"] - person.truth, axis=2)[50:56]
    assert error[:, HANDS["left"]].max() < 25 and error[:, HANDS["right"]].max() < 25


@pytest.mark.parametrize("method", GOOD)
@pytest.mark.parametrize("first", [0, 97])
def test_at_the_clips_ends_the_arm_is_held_to_the_shoulder_with_growing_sigma(synthetic, tmp_path, method, first):
    person = synthetic.turning(swing=0.03)
    person.truth[:, :] += np.linspace(0, 60, 100)[:, None, None]
    person.xy[:, :] += np.linspace(0, 60, 100)[:, None, None]
    synthetic.lose(person, "left", first, first + 3, elbow=True)
    out, _ = synthetic.through_stage(person, tmp_path, method=method)
    assert out["filled"][first: first + 3, HANDS["left"]].all()
    assert np.linalg.norm(out["xy"] - person.truth, axis=2)[first: first + 3, PALM["left"]].max() < 25
    sigma = out["sigma"][first: first + 3, PALM["left"]]
    assert (np.diff(sigma if first else sigma[::-1]) > 0).all()


def test_what_is_too_long_stays_missing(synthetic, tmp_path):
    person = synthetic.turning()
    synthetic.lose(person, "left", 30, 45)
    synthetic.lose(person, "right", 0, 20)
    out, warnings = synthetic.through_stage(person, tmp_path, max_gap_s=1.5, max_hold_s=0.5)
    assert out["missing"][30:45, 0].all() and not out["filled"][:, HANDS["left"]].any()
    assert (out["score"][30:45, HANDS["left"]] == 0).all()
    assert np.flatnonzero(out["filled"][:, PALM["right"]]).tolist() == [15, 16, 17, 18, 19]
    assert any("left hand is missing in 15 of 100 frames (30-44)" in w for w in warnings)
    assert any("right hand is missing in 15 of 100 frames (0-14)" in w for w in warnings)


def test_sigma_grows_inside_a_gap_and_says_how_large_the_errors_are(synthetic, tmp_path):
    within = []
    for seed in range(6):
        person = synthetic.turning(seed=seed, start=seed)
        synthetic.lose(person, "left", 40, 55, elbow=True)
        out, _ = synthetic.through_stage(person, tmp_path / str(seed))
        sigma = out["sigma"][40:55, PALM["left"]]
        assert sigma[7] > sigma[0] > out["sigma"][39, PALM["left"]] and sigma[7] > sigma[14]
        assert (out["score"][40:55, PALM["left"]] < 0.5).all() and (out["score"][40:55, PALM["left"]] > 0).all()
        within.append(np.abs(out["xy"] - person.truth)[40:55, PALM["left"]] < sigma[:, None])
    assert 0.5 < np.mean(within) < 0.9  # six gaps only; the turntable test holds it closer


def test_a_worse_score_gives_a_larger_sigma(synthetic, tmp_path):
    person = synthetic.turning()
    person.score[:, 5] = 0.5
    out, _ = synthetic.through_stage(person, tmp_path)
    assert (out["sigma"][:, 5] > 1.5 * out["sigma"][:, 6]).all() and (out["sigma"] > 0).all()


def test_seen_points_are_untouched(synthetic, tmp_path):
    person = synthetic.turning()
    synthetic.lose(person, "left", 40, 50)
    out, _ = synthetic.through_stage(person, tmp_path)
    kept = ~out["filled"]
    assert np.array_equal(out["xy"][kept], person.xy.astype("f4")[kept])
    assert np.isnan(out["world"][out["filled"]]).all() and not np.isnan(out["world"][kept]).any()


def test_without_a_method_all_detections_stay_as_they_are(synthetic, tmp_path):
    person = synthetic.put_on_other(synthetic.lose(synthetic.turning(), "left", 40, 50), "right", 60, 66)
    out, warnings = synthetic.through_stage(person, tmp_path, method="none")
    assert np.array_equal(out["xy"], person.xy.astype("f4")) and np.array_equal(out["score"], person.score.astype("f4"))
    assert not out["missing"].any() and not out["filled"].any() and not warnings
    assert np.array_equal(out["world"], person.world.astype("f4")), "nothing is taken for unseen"


def test_every_named_method_exists_and_others_are_refused():
    assert (*METHODS, "none") == get_args(Method) and tuple(RULES) == get_args(Rule)
    with pytest.raises(BadInput, match="handgap.method.*'spline'.*hermite"):
        make_config(STAGE, {"method": "spline"})
    with pytest.raises(BadInput, match="handgap.max_gap_s"):
        make_config(STAGE, {"max_gap_s": -1})
    with pytest.raises(BadInput, match="handgap.lost_score"):
        make_config(STAGE, {"lost_score": 0.9})


@pytest.mark.parametrize("method", GOOD)
def test_nothing_breaks_when_little_is_seen(synthetic, method):
    person = synthetic.turning(frames=4)
    nothing = np.zeros((4, 2), bool)
    for seen in ([0], [3], [0, 3], [1, 2], []):
        hand = np.ones((4, 2), bool)
        hand[seen] = False
        config = make_config(STAGE, {"method": method})
        missing, world = MissingHands(hand, hand, hand, nothing), np.full((4, 133, 3), np.nan)
        xy, filled, drift = fill_gaps(person.xy, person.score, world, missing, person.times, config)
        assert np.isfinite(xy).all() and np.isfinite(drift).all() and filled.any() == bool(seen)


def test_frames_that_repeat_others_carry_no_points_and_their_hands_are_not_called_missing(synthetic, tmp_path):
    out, warnings = synthetic.through_stage(synthetic.turning(), tmp_path, repeated=range(20, 50))
    trunk = [5, 6, 11, 12]
    assert not out["score"][20:50, trunk].any() and (out["score"][50:, trunk] > 0.2).all()
    assert warnings == []


def test_frames_that_the_keypoints_lack_are_named_and_carry_no_points(synthetic, tmp_path):
    person = synthetic.turning()
    out, warnings = synthetic.through_stage(person, tmp_path, said=-20)
    assert len(out["xy"]) == len(person.xy) and not out["score"][-20:, [5, 6, 11, 12]].any()
    assert f"keypoints.npz lacks 20 of {len(person.xy)} frames" in warnings[0]
