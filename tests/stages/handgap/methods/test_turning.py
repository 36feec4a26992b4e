"""The default's arm: what a hidden palm is told by the joints above it, by the turn, and by time."""

import numpy as np

from gsac.stages.handgap.gap_frames import pick_frames
from gsac.stages.handgap.methods.turning import MOST_FRAMES, fit_usual_place, predict
from gsac.stages.handgap.turning_body import TurningBody

TORSO = 200.0


def watched(times: np.ndarray, turn: np.ndarray) -> TurningBody:
    return TurningBody(np.zeros((len(times), 2)), turn, TORSO, times, np.ones((len(times), 133), bool))


def arm(swing: np.ndarray, turn: np.ndarray, seed: int = 0) -> np.ndarray:
    """(T, 4, 2) px: a straight arm, `swing` rad from hanging down in the body's plane, detected to a pixel."""
    along = np.stack([np.sin(swing), np.cos(swing)], 1)
    points = np.array([0.36, -0.5]) + np.array([0, 0.55, 1.05, 1.25])[:, None] * along[:, None]
    points[..., 0] *= np.cos(turn)[:, None]
    return TORSO * points + np.random.default_rng(seed).normal(0, 1.0, points.shape)


def hidden(frames: int, first: int, last: int, joints=(2, 3)) -> np.ndarray:
    """(4, T) bool of the points that are shown."""
    shown = np.ones((4, frames), bool)
    shown[np.ix_(joints, range(first, last))] = False
    return shown


def test_an_elbow_that_is_seen_carries_the_hidden_palm_along():
    times = np.arange(60) / 10
    swing = 0.5 + 0.4 * np.exp(-0.5 * ((times - 3.0) / 0.4) ** 2)  # nothing before or after the gap tells of it
    tracks, turn = arm(swing, 0 * times), np.zeros(60)
    off = {}
    for name, joints in (("elbow seen", (2, 3)), ("elbow hidden", (1, 2, 3))):
        shown = hidden(60, 22, 38, joints)
        place, _ = predict(tracks, shown, ~shown, watched(times, turn))
        off[name] = np.linalg.norm(place[30, 3] - tracks[30, 3])
    assert off["elbow seen"] < 0.15 * TORSO < off["elbow hidden"]


def test_the_turn_takes_a_still_arm_through_a_long_gap():
    times = np.arange(80) / 10
    turn = 2 * np.pi * times / 8
    tracks = arm(np.full(80, 0.5), turn)
    shown = hidden(80, 25, 49, (1, 2, 3))
    place, spread = predict(tracks, shown, ~shown, watched(times, turn))
    off = np.linalg.norm(place[25:49, 3] - tracks[25:49, 3], axis=1)
    assert off.max() < 0.1 * TORSO and spread[37, 3].mean() > spread[25, 3].mean()


def test_the_usual_place_is_read_off_the_turn():
    turn = np.linspace(0, 2 * np.pi, 50)
    place = np.array([0.3, -0.2, 0.1])
    track = np.stack([place[0] * np.cos(turn) + place[2] * np.sin(turn), np.full(50, place[1])], 1)
    np.testing.assert_allclose(fit_usual_place(track, np.ones(50, bool), turn), place, atol=0.01)
    assert not fit_usual_place(track, np.zeros(50, bool), turn).any()


def test_a_long_clip_is_told_from_the_frames_around_each_gap():
    times = np.arange(400) / 10
    asked = np.zeros(400, bool)
    asked[200:210] = True
    used = np.zeros(400, bool)
    used[pick_frames(~asked, asked, times, MOST_FRAMES)] = True
    assert used.sum() <= 1.3 * MOST_FRAMES and used[190:200].all() and used[:150].any() and used[300:].any()
    swing = 0.5 + 0.1 * np.sin(2 * np.pi * 0.5 * times)
    turn = 2 * np.pi * times / 10
    tracks, shown = arm(swing, turn), hidden(400, 200, 206, (1, 2, 3))
    shown[:, 300:304] = False
    place, _ = predict(tracks, shown, ~shown, watched(times, turn))
    for gap in (range(200, 206), range(300, 304)):
        assert np.linalg.norm(place[gap, 3] - tracks[gap, 3], axis=1).max() < 0.1 * TORSO
