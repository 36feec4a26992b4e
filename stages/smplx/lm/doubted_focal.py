"""A focal length that is given and wrong: the pictures contradict it.

How a person's picture changes with the distance of limbs through a turn tells the focal length: the given one should explain the
points as well as the one that is found from the person. Where it is no phone's main lens, both are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gsac.avatar.body import Body
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


def fit_with_doubt(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                   progress: Callable[[int, int, str], None], arms_told: bool = True) -> Fit:
    """Fits the clip; where an unusual focal length was given, once more without it, and takes what explains the pictures better.

    arms_told: of `fit_clip`.
    """
    fit = fit_clip(body, sightings, outlines, config, progress, arms_told)
    given = config.focal_px or sightings.focal_px
    free = replace(sightings, focal_px=None), replace(config, focal_px=None)
    if not given or USUAL[0] <= given / focal_prior(*free)[0] <= USUAL[1]:
        return fit
    found = fit_clip(body, free[0], outlines, free[1], progress, arms_told)
    return found if found.cost < CHEAPER * fit.cost else fit
