"""Likeness of held-out frames: what is told beside the figures."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.stages.train.judge import likeness


@pytest.fixture
def poses():
    """Two frames: from the front, and turned to the own left."""
    turns = [Rotation.from_euler("x", 180, degrees=True) * Rotation.from_euler("y", angle, degrees=True) for angle in (0, 90)]
    return SimpleNamespace(pose=np.stack([turn.as_rotvec()[None] for turn in turns]))


def test_a_part_is_told_with_the_side_from_which_it_is_least_alike(poses):
    found = [({"structure": 0.9, "psnr": 30.0}, 0), ({"structure": 0.7, "psnr": 20.0}, 1)]
    told = likeness.describe(found, poses)
    assert told["worst_view"] == "right side" and told["worst"] == 0.7 and told["structure"] == pytest.approx(0.8)
    assert likeness.describe([], poses) is None


def test_the_extent_is_told_as_filmed_however_small_the_judged_view_is(poses, monkeypatch):
    monkeypatch.setattr(likeness, "render_view", lambda *_: (None, None))
    monkeypatch.setattr(likeness, "truth", lambda _: (None, None))
    monkeypatch.setattr(likeness, "find_boxes", lambda *_: {})
    monkeypatch.setattr(likeness, "compare_parts", lambda *_: {"body": [{"structure": 0.9, "psnr": 30.0, "px": 400.0}], "face": [],
                                                               "hands": []})
    view = SimpleNamespace(camera=SimpleNamespace(height=540))
    told = likeness.judge_likeness(None, poses, [0], {0: view}, 1080)
    assert told["body"]["px"] == 800 and told["body"]["worst_view"] == "front" and told["face"] is None
