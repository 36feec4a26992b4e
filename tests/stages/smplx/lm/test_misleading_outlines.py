"""Outlines that mislead: of clothes that hide the figure, of pictures that the body does not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.avatar.artifacts import frame_paths
from gsac.avatar.frame_files import read_alpha, write_alpha
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm import misleading_outlines
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.misleading_outlines import NO_CLOTHES, STRANGE, THICK, fit_unmisled
from gsac.stages.smplx.lost_frames import LOOSE_IOU
from gsac.stages.smplx.silhouette import read_outline
from gsac.stages.smplx.state import Fit, State, to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, outlines_of, sightings_of, turning_person

CENTER = np.array([WIDTH / 2, HEIGHT / 2])


@pytest.fixture
def fit_dressed(body, monkeypatch):
    """(figure, spreads; thickness of one garment, cm; its name; IoU of all frames) -> the fit, and the outline's weight in each fit
    that it took, negative where arms were not looked for."""
    def fit(figure: float, thick: float, name: str = "thighs", iou: float = 1.0) -> tuple[Fit, list[float]]:
        weights = []

        def answer(body, sightings, outlines, config, progress, arms_told=True):
            weights.append(config.silhouette if arms_told else -config.silhouette)
            betas = np.append(np.full(body.num_figure, figure), np.where(np.array(body.clothes) == name, thick, 1.0))
            state = State(np.zeros((1, 55, 3, 3)), np.zeros((1, 3)), betas, 0.0, np.zeros(0))
            return Fit(state, np.zeros((1, 55)), np.full(1, iou), np.zeros(1), 1)

        monkeypatch.setattr(misleading_outlines, "fit_with_doubt", answer)
        return fit_unmisled(body, None, [], SmplxConfig(silhouette=1.0), lambda *a: None), weights

    return fit


def test_a_skirt_that_makes_a_figure_no_person_has_is_named_and_its_outline_hardly_counts(fit_dressed):
    fit, weights = fit_dressed(STRANGE + 0.3, 5.3)
    (note,) = fit.notes
    assert note.code is Code.CLOTHES_HIDE_SHAPE and note.figure == pytest.approx(5.3) and 0 < weights[1] < 0.2 * weights[0]


@pytest.mark.parametrize(("thick", "name"), [(THICK + 1, "thighs"), (3.9, "feet")])
def test_thick_clothes_over_a_usual_figure_are_named_and_fitted_once(fit_dressed, thick, name):
    fit, weights = fit_dressed(0.8, thick, name)
    assert [note.code for note in fit.notes] == [Code.CLOTHES_HIDE_SHAPE] and len(weights) == 1


@pytest.mark.parametrize(("figure", "thick", "name"), [(0.8, 2.5, "thighs"), (1.9, 2.5, "chest"), (0.8, 8.0, "hair")])
def test_usual_clothes_an_unusual_figure_and_much_hair_are_not_accused(fit_dressed, figure, thick, name):
    fit, weights = fit_dressed(figure, thick, name)
    assert not fit.notes and len(weights) == 1


def test_pictures_that_the_body_mostly_does_not_fit_are_fitted_by_their_points_and_no_arm_is_looked_for(fit_dressed):
    fit, weights = fit_dressed(0.8, 2.5, iou=LOOSE_IOU - 0.02)
    assert len(weights) == 2 and 0 < -weights[1] < 0.2 * weights[0]
    assert len(fit_dressed(0.8, 2.5, iou=LOOSE_IOU + 0.02)[1]) == 1


def test_outlines_that_mix_moments_of_a_turn_do_not_lead_the_limbs(body, tmp_path):
    truth = turning_person(body, 16)
    seen, config = sightings_of(body, truth, noise=3), SmplxConfig(height_m=height_of(body, truth), rounds=1)
    outlines_of(body, truth, tmp_path)
    alphas = [read_alpha(path) for path in frame_paths(tmp_path)]
    (tmp_path / "mixed").mkdir()
    mixed = []
    for t in range(truth.frames):
        path = tmp_path / "mixed" / f"{t:06d}.exr"
        write_alpha(path, np.max(alphas[max(t - 2, 0):t + 3], 0))
        mixed.append(read_outline(path))
    with threadpool_limits(1, "blas"):
        fits = [fit(body, seen, mixed, config, lambda *a: None) for fit in (fit_unmisled, fit_clip)]
    off, by_outline = (joint_error_mm(body, to_params(body, fit.state, CENTER), truth).mean() for fit in fits)
    assert off < 0.8 * by_outline, f"{off} {by_outline}"


def test_under_clothes_ten_centimetres_thick_the_points_shape_the_figure(body, tmp_path):
    bare = turning_person(body, 5)
    betas = bare.betas.copy()
    betas[body.num_figure:] = [0 if name in NO_CLOTHES or name == "feet" else 10 for name in body.clothes]
    outlines = outlines_of(body, replace(bare, betas=betas), tmp_path)
    config = SmplxConfig(height_m=height_of(body, bare), rounds=1)
    with threadpool_limits(1, "blas"):
        fit = fit_unmisled(body, sightings_of(body, bare), outlines, config, lambda *a: None)
    assert Code.CLOTHES_HIDE_SHAPE in [note.code for note in fit.notes]
    off = (fit.state.betas - bare.betas)[:body.num_figure]
    assert np.sqrt(np.mean(off**2)) < 0.8, "by the outline alone it is 1.95"
    found = to_params(body, fit.state, CENTER)
    assert joint_error_mm(body, found, bare).mean() < 18
