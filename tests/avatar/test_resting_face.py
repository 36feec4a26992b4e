"""The person's face at rest, from the actions of frames in which nobody holds still."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar.body import Body
from gsac.avatar.resting_face import find_resting_face

NAMES = Body.load().expression_names


def rest_of(frames: int = 90, seen: int = 90) -> dict[str, float]:
    """What is found of a person with heavy lids and a slight smile who talks, laughs now and then, and blinks."""
    rng, t = np.random.default_rng(4), np.arange(frames)
    c = np.abs(rng.normal(0, 0.02, (frames, len(NAMES))))
    c[:, NAMES.index("jawOpen")] += np.clip(0.5 * np.sin(1.1 * t), 0, 1)
    c[:, NAMES.index("mouthSmileLeft")] += 0.15 + 0.6 * (t % 30 < 8)
    for side in ("Left", "Right"):
        c[:, NAMES.index(f"eyeBlink{side}")] += 0.2 + 0.7 * (t % 12 < 2)
    return dict(zip(NAMES, find_resting_face(c[:seen], np.ones(seen)), strict=True))


@pytest.mark.parametrize("seen", [90, 12])
def test_a_person_who_talks_laughs_and_blinks_rests_with_the_mouth_closed_and_the_eyes_open_as_they_are(seen):
    rest = rest_of(seen=seen)
    assert rest["jawOpen"] < 0.04, "not the mean, .2, of a mouth that speaks"
    assert rest["mouthSmileLeft"] == pytest.approx(0.16, abs=0.03), "what lasts is the person's own, a laugh is not"
    for side in ("Left", "Right"):
        assert rest[f"eyeBlink{side}"] == pytest.approx(0.21, abs=0.03), "lids as low as the person has them, and no lower"
    others = [value for name, value in rest.items() if not name.startswith(("jawOpen", "mouthSmileLeft", "eyeBlink"))]
    assert max(others) < 0.02, "noise is nobody's face"


def test_of_a_few_photos_the_one_from_the_side_counts_least():
    funnel, towards = NAMES.index("mouthFunnel"), np.array([1.0, 0.6, 1.0])
    c = np.zeros((3, len(NAMES)))
    c[:, funnel] = 0.24, 0.0, 0.2
    assert find_resting_face(c, towards)[funnel] == 0.2
    assert find_resting_face(c, np.roll(towards, 1))[funnel] == 0.0
    np.testing.assert_array_equal(find_resting_face(c[:1], towards[:1]), c[0])
