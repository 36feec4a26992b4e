"""Clothes that hide the figure."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm import wide_clothes
from gsac.stages.smplx.lm.wide_clothes import STRANGE, fit_under_clothes
from gsac.stages.smplx.state import Fit, State


@pytest.fixture
def fit_of_skirt(body, monkeypatch):
    """A fit whose figure is `strange` spreads away by a strong outline and `freed` by a weak one; the weights asked for."""
    weights = []

    def fit(strange: float, freed: float, config: SmplxConfig) -> Fit:
        def answer(body, sightings, outlines, config, progress):
            weights.append(config.silhouette)
            betas = np.full(body.num_betas, strange if config.silhouette == 1 else freed)
            state = State(np.zeros((1, 55, 3, 3)), np.zeros((1, 3)), betas, 0.0, np.zeros(0))
            return Fit(state, np.zeros((1, 55)), np.ones(1), np.zeros(1), 1, None)

        monkeypatch.setattr(wide_clothes, "fit_with_doubt", answer)
        return fit_under_clothes(body, None, [], config, lambda *a: None)

    return fit, weights


def test_a_figure_that_no_person_has_is_fitted_anew_by_the_key_points_and_named(fit_of_skirt):
    fit, weights = fit_of_skirt
    found = fit(2.0, 0.7, SmplxConfig(silhouette=1.0))
    (note,) = found.notes
    assert note.code is Code.CLOTHES_HIDE_SHAPE and note.figure == pytest.approx(2.0)
    assert found.state.betas[0] == 0.7 and weights[1] < 0.2 * weights[0]


def test_a_figure_that_people_have_costs_one_fit_and_is_not_accused(fit_of_skirt):
    fit, weights = fit_of_skirt
    assert not fit(0.9 * STRANGE, 0.7, SmplxConfig(silhouette=1.0)).notes and len(weights) == 1


def test_a_figure_that_the_key_points_find_as_strange_is_the_persons(fit_of_skirt):
    fit, _ = fit_of_skirt
    found = fit(2.0, 2.1, SmplxConfig(silhouette=1.0))
    assert not found.notes and found.state.betas[0] == 2.0
