"""The field of an outline tells how far it is to the edge."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.stages.smplx.silhouette import make_outline


@pytest.mark.parametrize("size", [1, 3])
def test_the_distance_is_to_the_edge_itself_in_pixels_of_the_frame(size):
    alpha = np.zeros((320 * size, 240 * size), np.float32)
    alpha[:, : 100 * size] = 1

    outline = make_outline(alpha)
    x = np.array([96.0, 99.5, 100.0, 100.5, 104.0]) * size
    distance, slope, inside = outline.at(np.stack([x, np.full(5, 160.0 * size)], 1))

    assert inside.all() and outline.scale == size
    assert distance == pytest.approx(x - 100 * size, abs=0.01 * size)
    assert slope == pytest.approx(np.tile([1.0, 0.0], (5, 1)), abs=0.01)


def test_a_disc_is_met_at_its_rim_to_a_tenth_of_a_pixel():
    y, x = np.mgrid[:320, :240] + 0.5
    outline = make_outline(np.clip(60.5 - np.hypot(x - 120, y - 160), 0, 1).astype(np.float32))
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    rim = np.stack([120 + 60 * np.cos(angle), 160 + 60 * np.sin(angle)], 1)
    assert outline.at(rim)[0].mean() == pytest.approx(0, abs=0.1)
