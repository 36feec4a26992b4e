"""Coarser levels of detail: fitted to small frames, drawn where they show the person as well as more gaussians do."""

import json

import numpy as np
import pytest

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.fast import drawn_height, lod
from gsac.stages.train.stage import run


@pytest.mark.slow
def test_a_level_is_drawn_up_to_where_it_is_as_good_as_more_gaussians(job_anywhere, monkeypatch):
    monkeypatch.setattr(lod, "LEAST", 30)
    lost, measure = [], drawn_height.measure_losses
    monkeypatch.setattr(drawn_height, "measure_losses", lambda *args: (found := measure(*args), lost.append(found.min()))[0])
    made = job_anywhere(gaussians=1800, steps=90, pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())["levels"]
    finest, *coarser = Gaussians.read_levels(made.out / "avatar.npz")
    assert [row["n_gaussians"] for row in figures] == [len(level) for level in coarser]
    assert [len(finest) // 3, len(finest) // 9] == [len(level) for level in coarser]
    assert [row["image_height"] for row in figures] == [64, 32]
    tall, small = (level.max_height_px for level in coarser)
    assert finest.max_height_px is None and 64 >= tall > small >= 4, "of persons lower than the frame"
    assert lost[0] < -0.5 and len(lost) == 2, "dB: from afar better than more gaussians"
    for level in coarser:
        np.testing.assert_array_equal(level.light, finest.light)


def test_few_gaussians_have_no_coarser_level(job_anywhere):
    made = job_anywhere(gaussians=200, frames=2, steps=2, pose_test_steps=0)
    run(made)
    assert len(Gaussians.read_levels(made.out / "avatar.npz")) == 1
    assert json.loads((made.out / "metrics.json").read_text())["levels"] == []
