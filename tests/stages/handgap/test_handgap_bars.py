"""The bars, on bodies that turn with sway and swinging arms and a detector's errors: benchmarks/handgap, a small part."""

import numpy as np
import pytest

from gsac.benchmarks.handgap.clips import make_turning_body
from gsac.benchmarks.handgap.failures import measure_detection
from gsac.benchmarks.handgap.gaps import measure, summarise

pytestmark = pytest.mark.slow
METHODS = ("turning", "gp", "hermite", "paper")
LOST = ("arm", "hand")


@pytest.fixture(scope="module")
def clips():
    return {seed: make_turning_body(seed) for seed in (1, 2, 3, 4, 5)}


@pytest.fixture(scope="module")
def errors(clips):
    """place, what is lost, gap, method -> mean palm error px; within: share of all errors within sigma."""
    rows = measure(clips, METHODS, gaps=(2, 8, 24), inside=4)
    means = {(r["place"], r["lost"], r["gap"], r["method"]): r["mean_px"] for r in summarise(rows)}
    return means | {"within": np.concatenate([r["within"] for r in rows if r["method"] == "turning"]).mean()}


@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("gap", [8, 24])
def test_the_default_halves_the_papers_error(errors, lost, gap):
    assert errors["inside", lost, gap, "turning"] <= 0.5 * errors["inside", lost, gap, "paper"]


@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("gap", [2, 8, 24])
def test_no_other_method_is_better(errors, lost, gap):
    assert errors["inside", lost, gap, "turning"] <= 1.05 * min(errors["inside", lost, gap, m] for m in METHODS[1:])


@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("gap", [2, 8, 24])
def test_at_the_clips_ends_half_the_error_of_holding_still(errors, lost, gap):
    assert errors["end", lost, gap, "turning"] <= 0.5 * errors["end", lost, gap, "paper"]


def test_two_errors_of_three_lie_within_sigma(errors):
    assert 0.6 <= errors["within"] <= 0.85


def test_missing_and_misplaced_hands_are_found(clips):
    for row in measure_detection(clips):
        assert row["wrong"] == 0 or row["recall"] >= 0.95, row
        assert row["false_alarms"] <= 0.01, row
