"""Clothes so wide that the outline no longer tells the figure: skirts, coats, hoodies a hand wider than the body.

The outline then makes a figure that no person has, and its joints go with it; the key points alone know better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.doubted_focal import fit_with_doubt
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.state import Fit

STRANGE = 1.5
"""Root mean square of a figure's betas, in spreads, that one person in a thousand exceeds (20 betas, chi-squared). Three rendered
people, photos and squats have 0.5 to 0.8; skirts and hoodies three times as thick as usual 1.8 to 2.0."""
WEAK = 0.05
"""Factor on the outline's weight under such clothes: it hardly shapes the figure, and still tells frames that lie apart."""


def fit_under_clothes(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                      progress: Callable[[int, int, str], None]) -> Fit:
    """Fits the clip; where the figure is no person's, once more with a weak outline."""
    fit = fit_with_doubt(body, sightings, outlines, config, progress)
    strange = measure_strangeness(body, fit.state.betas)
    if config.silhouette == 0 or strange < STRANGE:
        return fit
    freed = fit_with_doubt(body, sightings, outlines, replace(config, silhouette=WEAK * config.silhouette), progress)
    if measure_strangeness(body, freed.state.betas) >= strange:
        return fit
    return replace(freed, notes=(*freed.notes, Finding.of(Code.CLOTHES_HIDE_SHAPE, figure=strange)))


def measure_strangeness(body: Body, betas: np.ndarray) -> float:
    """Root mean square of the figure's betas, in spreads of people: 1 of most. betas: (B,), the figure's and the clothes'."""
    return float(np.sqrt(np.mean(betas[:body.num_figure] ** 2)))
