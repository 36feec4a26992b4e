"""The bars, on bodies that turn with sway and swinging arms and a detector's errors: benchmarks/handgap, a small part."""

import numpy as np
import pytest
from gsac.benchmarks.handgap.clips import turning_body
from gsac.benchmarks.handgap.failures import detection
from gsac.benchmarks.handgap.gaps import measure, summary

pytestmark = pytest.mark.slow
METHODS = ("turning", "gp", "hermite", "paper")


@pytest.fixture(scope="module")
def clips():
    return {seed: turning_body(seed) for seed in (1, 2, 3, 4, 5)}


@pytest.fixture(scope="module")
def errors(clips):
    """place, gap, method -> mean palm error px where the whole arm was lost; within: share of all errors within sigma."""
    rows = measure(clips, METHODS, gaps=(2, 8, 16, 32), inside=5)
    means = {(r["place"], r["gap"], r["method"]): r["mean_px"] for r in summary(rows) if r["lost"] == "arm"}
    return means | {"within": np.concatenate([r["within"] for r in rows if r["method"] == "turning"]).mean()}


@pytest.mark.parametrize("gap", [8, 16, 32])
def test_the_default_halves_the_papers_error(errors, gap):
    assert errors["inside", gap, "turning"] <= 0.5 * errors["inside", gap, "paper"]


@pytest.mark.parametrize("gap", [2, 8, 16, 32])
def test_no_other_method_is_better(errors, gap):
    assert errors["inside", gap, "turning"] <= 1.05 * min(errors["inside", gap, m] for m in METHODS[1:])


@pytest.mark.parametrize("gap", [8, 16, 32])
def test_at_the_clips_ends_half_the_error_of_holding_still(errors, gap):
    assert errors["end", gap, "turning"] <= 0.5 * errors["end", gap, "paper"]


def test_two_errors_of_three_lie_within_sigma(errors):
    assert 0.6 <= errors["within"] <= 0.85


def test_missing_and_misplaced_hands_are_found(clips):
    for row in detection(clips):
        assert row["wrong"] == 0 or row["recall"] >= 0.95, row
        assert row["false_alarms"] <= 0.01, row
