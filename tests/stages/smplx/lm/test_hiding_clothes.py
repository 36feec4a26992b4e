"""Clothes that hide the figure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm import hiding_clothes
from gsac.stages.smplx.lm.hiding_clothes import NO_CLOTHES, STRANGE, THICK, fit_under_clothes
from gsac.stages.smplx.state import Fit, State, to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, outlines_of, sightings_of, turning_person


@pytest.fixture
def fit_dressed(body, monkeypatch):
    """(figure, spreads; thickness of one garment, cm; its name) -> the fit, and the outline's weight in each fit that it took."""
    def fit(figure: float, thick: float, name: str = "thighs") -> tuple[Fit, list[float]]:
        weights = []

        def answer(body, sightings, outlines, config, progress):
            weights.append(config.silhouette)
            betas = np.append(np.full(body.num_figure, figure), np.where(np.array(body.clothes) == name, thick, 1.0))
            state = State(np.zeros((1, 55, 3, 3)), np.zeros((1, 3)), betas, 0.0, np.zeros(0))
            return Fit(state, np.zeros((1, 55)), np.ones(1), np.zeros(1), 1)

        monkeypatch.setattr(hiding_clothes, "fit_with_doubt", answer)
        return fit_under_clothes(body, None, [], SmplxConfig(silhouette=1.0), lambda *a: None), weights

    return fit


def test_a_skirt_that_makes_a_figure_no_person_has_is_named_and_its_outline_hardly_counts(fit_dressed):
    fit, weights = fit_dressed(STRANGE + 0.3, 5.3)
    (note,) = fit.notes
    assert note.code is Code.CLOTHES_HIDE_SHAPE and note.figure == pytest.approx(5.3) and weights[1] < 0.2 * weights[0]


@pytest.mark.parametrize(("thick", "name"), [(THICK + 1, "thighs"), (3.9, "feet")])
def test_thick_clothes_over_a_usual_figure_are_named_and_fitted_once(fit_dressed, thick, name):
    fit, weights = fit_dressed(0.8, thick, name)
    assert [note.code for note in fit.notes] == [Code.CLOTHES_HIDE_SHAPE] and len(weights) == 1


@pytest.mark.parametrize(("figure", "thick", "name"), [(0.8, 2.5, "thighs"), (1.9, 2.5, "chest"), (0.8, 8.0, "hair")])
def test_usual_clothes_an_unusual_figure_and_much_hair_are_not_accused(fit_dressed, figure, thick, name):
    fit, weights = fit_dressed(figure, thick, name)
    assert not fit.notes and len(weights) == 1


def test_under_clothes_ten_centimetres_thick_the_points_shape_the_figure(body, tmp_path):
    bare = turning_person(body, 5)
    betas = bare.betas.copy()
    betas[body.num_figure:] = [0 if name in NO_CLOTHES or name == "feet" else 10 for name in body.clothes]
    outlines = outlines_of(body, replace(bare, betas=betas), tmp_path)
    config = SmplxConfig(height_m=height_of(body, bare), rounds=1)
    with threadpool_limits(1, "blas"):
        fit = fit_under_clothes(body, sightings_of(body, bare), outlines, config, lambda *a: None)
    assert Code.CLOTHES_HIDE_SHAPE in [note.code for note in fit.notes]
    off = (fit.state.betas - bare.betas)[:body.num_figure]
    assert np.sqrt(np.mean(off**2)) < 0.8, "by the outline alone it is 1.95"
    found = to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2]))
    assert joint_error_mm(body, found, bare).mean() < 18
