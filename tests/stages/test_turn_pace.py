"""Slow turns are timed as if they took 20 s."""

import numpy as np
import pytest

from gsac.stages.first_look import LEFT, RIGHT
from gsac.stages.turn_pace import pace


def turning(degrees, frames=40):
    """world (T, 133, 3) of shoulders and hips that turn by so many degrees."""
    angle, world = np.radians(np.linspace(0, degrees, frames)), np.zeros((frames, 133, 3))
    left = 0.2 * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], 1)
    world[:, LEFT], world[:, RIGHT] = left[:, None], -left[:, None]
    return world


@pytest.mark.parametrize(("degrees", "seconds", "as_of"), [
    (360, 60, 20), (-360, 60, 20), (720, 60, 40), (360, 20, 20), (360, 6, 6),
    (90, 60, 60),  # who only sways is no slow turn
])
def test_a_turn_slower_than_twenty_seconds_is_timed_as_one_of_twenty(degrees, seconds, as_of):
    times = np.linspace(1, 1 + seconds, 40)
    assert np.ptp(pace(times, turning(degrees))) == pytest.approx(as_of, rel=1e-6)


def test_frames_of_nobody_do_not_count():
    world = turning(360)
    world[[0, 7, 8]], world[[20, 39]] = np.nan, 0
    times = np.linspace(0, 60, 40)
    assert np.ptp(pace(times, world)) == pytest.approx(20, rel=1e-6)
    assert pace(times, np.full((40, 133, 3), np.nan)) is times
