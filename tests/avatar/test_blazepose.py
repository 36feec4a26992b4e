"""BlazePose's answers, told apart from what it makes of empty rooms."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gsac.avatar import blazepose
from gsac.avatar.blazepose import PoseNetworks
from gsac.avatar.region import full_frame

WIDTH, HEIGHT = 90, 160


@pytest.mark.parametrize("hips, is_one", [((45, 80), True), ((45, 200), True), ((-60, 80), True), ((-257, 177), False),
                                          ((45, 330), False)])
def test_a_giant_whose_hips_lie_far_outside_the_picture_is_nobody(monkeypatch, hips, is_one):
    networks = object.__new__(PoseNetworks)
    networks._detector = lambda image: (None, None)
    networks._detector.width = networks._anchors = 224
    frame = full_frame(WIDTH, HEIGHT)
    unit = frame.to_frame(np.array([[0.0, 0.0], [1.0, 1.0]]))
    circle = [(np.array(place, float) - unit[0]) / (unit[1] - unit[0]) for place in (hips, (hips[0], hips[1] - 50))]
    monkeypatch.setattr(blazepose, "decode", lambda *arguments: None)
    monkeypatch.setattr(blazepose, "suppress", lambda found: SimpleNamespace(points=np.array([circle]), score=np.array([0.6])))
    found = networks.persons(np.zeros((HEIGHT, WIDTH, 3), np.uint8), 0.5)
    assert [person.region.center for person in found] == ([pytest.approx(hips)] if is_one else [])
