"""Coarser levels of detail: fitted at the size at which they are seen."""

import json

import numpy as np
import pytest

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.fast import lod
from gsac.stages.train.stage import run


@pytest.mark.slow
def test_a_level_draws_better_at_its_own_size_than_the_finest_does(job_anywhere, monkeypatch):
    monkeypatch.setattr(lod, "LEAST", 30)
    made = job_anywhere(gaussians=1800, steps=90, pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())["levels"]
    finest, *coarser = Gaussians.read_levels(made.out / "avatar.npz")
    assert [row["n_gaussians"] for row in figures] == [len(level) for level in coarser]
    assert [len(finest) // 3, len(finest) // 9] == [len(level) for level in coarser]
    assert [row["image_height"] for row in figures] == [64, 32]
    for row in figures:
        assert row["psnr_fg"] > row["psnr_fg_finest"] + 0.5
    assert [round(level.max_height_px / coarser[0].max_height_px, 1) for level in coarser] == [1, .5]
    assert finest.max_height_px is None and 16 < coarser[0].max_height_px <= 64, "a person as high as half of the frame, or more"
    for level in coarser:
        np.testing.assert_array_equal(level.light, finest.light)


def test_few_gaussians_have_no_coarser_level(job_anywhere):
    made = job_anywhere(gaussians=200, frames=2, steps=2, pose_test_steps=0)
    run(made)
    assert len(Gaussians.read_levels(made.out / "avatar.npz")) == 1
    assert json.loads((made.out / "metrics.json").read_text())["levels"] == []
