"""Clothes so wide that their outline makes a figure that no person has, and its joints go with it; the key points know better."""

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
    """Fits the clip; where the figure is no person's, once more with a weak outline, if that makes one that is."""
    weak = replace(config, silhouette=WEAK * config.silhouette)
    fit = fit_with_doubt(body, sightings, outlines, config, progress)
    strange = float(np.sqrt(np.mean(fit.state.betas[:body.num_figure] ** 2)))
    if config.silhouette == 0 or strange < STRANGE:
        return fit
    freed = fit_with_doubt(body, sightings, outlines, weak, progress)
    if np.sqrt(np.mean(freed.state.betas[:body.num_figure] ** 2)) >= STRANGE:
        return fit
    return replace(freed, notes=(*freed.notes, Finding.of(Code.CLOTHES_HIDE_SHAPE, figure=strange)))
