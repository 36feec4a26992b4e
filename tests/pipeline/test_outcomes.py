"""Every member of every enum that users read has its words, and no two members the same."""

import pytest

from gsac.cache.key import ChangeKind
from gsac.pipeline import plan
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.plan import LEADING, Reason
from gsac.pipeline.reporter import Verbosity


@pytest.mark.parametrize("words", [ExitCode, Outcome, Reason, Verbosity])
def test_every_member_has_a_sentence_of_its_own(words):
    sentences = [member.sentence for member in words]
    assert all(sentences) and len(set(sentences)) == len(words)


def test_every_outcome_has_a_colour():
    assert all(outcome.style for outcome in Outcome)


def test_every_change_of_a_key_is_a_reason_to_run_that_can_lead():
    """A stage is only compared with earlier runs of itself: its name never changes."""
    assert set(plan._BY_CHANGE) == set(ChangeKind) - {ChangeKind.STAGE}
    assert set(plan._BY_CHANGE.values()) == set(LEADING)


def test_exit_codes_are_the_numbers_that_scripts_rely_on():
    assert {code.name: int(code) for code in ExitCode} == {
        "OK": 0, "FAILED": 1, "USAGE": 2, "STALE": 3, "INTEGRITY": 4, "INTERRUPTED": 130}
