"""A few trials, always the same, of what `make attack` tries by the thousand."""

from __future__ import annotations

import pytest
from attack.batches import kill_in_batches
from attack.kills import kill_at_random
from attack.subjects import ToyBatch

pytestmark = pytest.mark.slow


def test_runs_killed_at_random_moments_leave_nothing_torn_lost_wrong_stuck_or_lying_about(toy):
    tally = kill_at_random(toy, trials=5, seed=3, attack="")
    assert tally.trials == 5 and not tally.faults, tally.examples


def test_batches_whose_process_clips_or_stages_are_killed_lose_nothing_either(tmp_path):
    tally = kill_in_batches(ToyBatch(tmp_path), trials=4, seed=2, attack="")
    assert tally.trials == 4 and len(tally.where) > 1 and not tally.faults, tally.examples
