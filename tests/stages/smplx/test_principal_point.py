"""Frames that show part of the footage: the lens looks beside their middle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.artifacts import Clip, Crop
from gsac.avatar.body import BodyParams
from gsac.stages.contract import Job
from gsac.stages.smplx import stage
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.paper import fit as paper
from gsac.stages.smplx.sightings import FOCAL_GUESS, focal_prior
from gsac.stages.smplx.warmup import HEIGHT as SMALL_HEIGHT
from gsac.stages.smplx.warmup import WIDTH as SMALL_WIDTH
from gsac.stages.smplx.warmup import write_inputs
from support.turning_person import sightings_of, turning_person

BESIDE = (430.0, 150.0)
"""px, where the lens looks; the frames are 360 px wide and 640 high."""


@pytest.fixture(scope="module")
def aside(body) -> BodyParams:
    """A person who turns in the middle of the frames, far from the middle of the footage."""
    return replace(turning_person(body, 2), center=np.array(BESIDE), transl=np.tile([-0.8, 0.5, 2.4], (2, 1)).astype(np.float32))


QUICK = {"lm": lambda body, seen: fit_clip(body, seen, [], SmplxConfig(silhouette=0, rounds=1, iterations=1), lambda *a: None),
         "paper": lambda body, seen: paper.fit_clip(body, seen, [], SmplxConfig(method="paper"), lambda *a: None,
                                                    (paper.Pass(10, 0.1, (5,), 5, True),))}


@pytest.mark.parametrize("method", QUICK)
def test_the_fit_of_frames_that_were_cut_is_that_of_the_whole_ones(body, aside, method):
    cut = replace(sightings_of(body, aside), principal_point=BESIDE)
    off = np.array([40, 170])
    size = 2 * (BESIDE + off)
    whole = replace(cut, xy=cut.xy + off, width=size[0], height=size[1], principal_point=None)
    of_cut, of_whole = (QUICK[method](body, seen).state for seen in (cut, whole))
    assert np.abs(of_cut.transl - of_whole.transl).max() < 1e-4 and np.abs(of_cut.local - of_whole.local).max() < 1e-4
    assert np.abs(of_cut.transl - aside.transl)[:, :2].max() < 0.1


def test_a_focal_length_is_guessed_from_the_footage_and_not_from_the_part_that_is_shown(body, aside):
    cut = Clip(None, None, 360, 640, None, "", crop=Crop(100, 200, 720, 1280, 0.5), center=BESIDE)
    seen = replace(sightings_of(body, aside), focal_px=None, principal_point=BESIDE, longer_side=cut.longer_side)
    assert focal_prior(seen, SmplxConfig())[0] == FOCAL_GUESS * 2 * (BESIDE[0] + 50)


def test_the_bodys_camera_looks_where_the_clip_says_that_the_lens_looked(body, tmp_path):
    inputs = write_inputs(body, tmp_path)
    clip = Clip.read(inputs["split/clip.json"])
    clip.crop, clip.center = Crop(30, 40, SMALL_WIDTH, SMALL_HEIGHT, 1.0), (31.0, 33.0)
    clip.write(inputs["split/clip.json"])
    (tmp_path / "out").mkdir()
    stage.run(Job(inputs, tmp_path / "out", SmplxConfig(rounds=1, iterations=1)))
    assert BodyParams.read(tmp_path / "out/body.npz").center == pytest.approx(np.array([31, 33]))
