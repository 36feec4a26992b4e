"""Second fits: of a clip whose given focal length the pictures contradict, and of one whose clothes hide the figure.

How a person's picture changes with the distance of limbs through a turn tells the focal length: the given one should explain the
points as well as the one that is found from the person. Where it is no phone's main lens, both are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.sightings import Sightings, focal_prior
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.state import Fit

USUAL = 0.75, 1.25
"""Factors on the house's own guess between which a given focal length is not doubted: phones' main lenses, and an error there costs
4 mm at most."""
CHEAPER = 0.95
"""Cost, over that with the given focal length, below which the found one is believed. Measured on turns: a right one, of wide,
main and tele lenses, costs at most 1.014 times as much as the found one; one that is 1.25 times too long 1.03 to 1.05, 1.5 times
1.09 to 1.11, 0.65 times 1.11 to 1.14."""
NO_CLOTHES, THICK = ("hair", "nape", "soles"), 4.0
"""Of clothes that hide a figure, cm: six clean clips have 2.5 at most, skirts and hoodies 2 or 3 times too thick 4 to 6.5."""
STRANGE = 1.5
"""Root mean square of a figure's betas, in spreads, that one person in a thousand exceeds (20 betas, chi-squared). Under skirts and
hoodies three times too thick it is 1.8 to 2.0; below, the outline serves all the same."""
WEAK = 0.05
"""Factor on the outline's weight where it misleads: it hardly shapes the figure, and still tells frames that lie apart."""


def fit_with_doubt(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                   progress: Callable[[int, int, str], None]) -> Fit:
    """Fits the clip; where an unusual focal length was given, once more without it, and takes what explains the pictures better."""
    fit = fit_clip(body, sightings, outlines, config, progress)
    given = config.focal_px or sightings.focal_px
    free = replace(sightings, focal_px=None), replace(config, focal_px=None)
    if not given or USUAL[0] <= given / focal_prior(*free)[0] <= USUAL[1]:
        return fit
    found = fit_clip(body, free[0], outlines, free[1], progress)
    return found if found.cost < CHEAPER * fit.cost else fit


def fit_under_clothes(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                      progress: Callable[[int, int, str], None]) -> Fit:
    """Fits the clip; where clothes are thick and the figure in them is no person's, once more with a weak outline."""
    fit = fit_with_doubt(body, sightings, outlines, config, progress)
    figure, clothes = np.split(fit.state.betas, [body.num_figure])
    thickest = max((cm for cm, name in zip(clothes, body.clothes, strict=True) if name not in NO_CLOTHES), default=0.0)
    if thickest < THICK:
        return fit
    if np.sqrt(np.mean(figure**2)) > STRANGE:
        fit = fit_with_doubt(body, sightings, outlines, replace(config, silhouette=WEAK * config.silhouette), progress)
    return replace(fit, notes=(*fit.notes, Finding.of(Code.CLOTHES_HIDE_SHAPE, figure=thickest)))
