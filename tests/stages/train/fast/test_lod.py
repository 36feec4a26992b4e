"""Coarser levels of detail: fitted to small frames, drawn where they show the person as well as more gaussians do."""

import json
from itertools import pairwise

import numpy as np
import pytest

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.fast import drawn_height, lod, size_search
from gsac.stages.train.gaussians.joint_cuts import uncut
from gsac.stages.train.stage import run

SMALL_LEVELS = (lod.Level(80, 600), lod.Level(50, 200))
"""For a person 86 px tall."""


@pytest.mark.slow
def test_a_level_is_drawn_up_to_where_it_is_as_good_as_more_gaussians(job_anywhere, monkeypatch):
    monkeypatch.setattr(lod, "LEVELS", SMALL_LEVELS)
    lost, measure = [], drawn_height.measure_losses
    monkeypatch.setattr(drawn_height, "measure_losses", lambda *args: (found := measure(*args), lost.append(found.min()))[0])
    made = job_anywhere(gaussians=1800, steps=90, pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())["levels"]
    finest, *coarser = Gaussians.read_levels(made.out / "avatar.npz")
    assert [row["n_gaussians"] for row in figures] == [len(level) for level in coarser]
    for level, (_, most) in zip(coarser, SMALL_LEVELS, strict=True):
        assert uncut(most) <= len(level) <= most
    assert [row["max_height_px"] for row in figures] == [level.max_height_px for level in coarser]
    tall, small = (level.max_height_px for level in coarser)
    assert finest.max_height_px is None and 86 > tall > small >= 12
    taller = [row["image_height"] / row["max_height_px"] for row in figures]
    assert taller == pytest.approx([128 / 86] * 2, rel=.05), "the frames, than the person"
    assert lost[0] < -0.5 and len(lost) == 2, "dB: from afar better than more gaussians"
    for level in coarser:
        np.testing.assert_array_equal(level.light, finest.light)


@pytest.mark.slow
def test_a_size_that_was_tried_and_not_taken_is_where_a_level_begins(job_anywhere, monkeypatch):
    merge, begun = lod.merge_trainer, []
    monkeypatch.setattr(lod, "merge_trainer", lambda gaussians, *args: (begun.append(len(gaussians)), merge(gaussians, *args))[1])
    monkeypatch.setattr(lod, "LEVELS", SMALL_LEVELS)
    monkeypatch.setattr(size_search, "list_sizes", lambda largest: (900, 620, 30))
    monkeypatch.setattr(size_search, "choose", lambda scores: scores[0])
    run(job_anywhere(gaussians="auto", frames=6, steps=12, pose_rounds=0, pose_test_steps=0))
    assert begun == [620, uncut(600)]


@pytest.mark.slow
def test_a_level_is_drawn_no_higher_than_the_one_before_also_with_a_number_that_was_asked_for(job_anywhere, monkeypatch):
    heights, looked_at = iter([40.0, 60.0]), []
    monkeypatch.setattr(lod, "find_drawn_height", lambda level, finer: (looked_at.append(set(level.frames)), next(heights))[1])
    monkeypatch.setattr(lod, "LEVELS", SMALL_LEVELS)
    made = job_anywhere(gaussians=900, frames=6, steps=12, pose_rounds=0, pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())
    assert [row["max_height_px"] for row in figures["levels"]] == [40, 40]
    assert looked_at == [set(figures["heldout_frames"])] * 2, "frames that were not trained on"


def test_an_avatar_540_px_tall_has_a_level_of_at_most_8000_gaussians_also_where_viewers_hesitate():
    first = lod.LEVELS[0]
    assert first.most <= 8000 and 0.9 * first.height >= 540


def test_every_level_has_fewer_gaussians_for_smaller_images():
    for finer, coarser in pairwise(lod.LEVELS):
        assert coarser.most <= lod.FEWER * finer.most and coarser.height <= lod.FEWER * finer.height


def test_few_gaussians_have_no_coarser_level(job_anywhere):
    made = job_anywhere(gaussians=200, frames=2, steps=2, pose_test_steps=0)
    run(made)
    assert len(Gaussians.read_levels(made.out / "avatar.npz")) == 1
    assert json.loads((made.out / "metrics.json").read_text())["levels"] == []
