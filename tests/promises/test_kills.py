"""A few trials, always the same, of what `make attack` tries by the thousand."""

from __future__ import annotations

import pytest
from attack.kills import kill_at_random

pytestmark = pytest.mark.slow


def test_runs_killed_at_random_moments_leave_nothing_torn_lost_wrong_stuck_or_lying_about(toy):
    tally = kill_at_random(toy, trials=5, seed=3, attack="")
    assert tally.trials == 5 and not tally.faults, tally.examples
