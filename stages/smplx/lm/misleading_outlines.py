"""Outlines that tell little of the body: of clothes that hide the figure, and of pictures that the body does not fit.

Skirts and hoodies drive the figure's betas to where no person is. Where pictures mix several moments, are compressed to blocks or
show a tiny person, outlines lie beside the body in most frames; they spread its legs, and arms that are looked for by them are
found where they are not. Then the key points tell the pose, and the outline hardly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.doubted_focal import fit_with_doubt
from gsac.stages.smplx.lost_frames import is_mostly_loose
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.state import Fit

NO_CLOTHES, THICK = ("hair", "nape", "soles"), 3.3
"""Of clothes that hide a figure, cm: six clean clips have 2.5 at most, skirts and hoodies 2 or 3 times too thick 4 to 6.5, a shirt
4 times too thick 3.96."""
STRANGE = 1.5
"""Root mean square of a figure's betas, in spreads, that one person in a thousand exceeds (20 betas, chi-squared). Under skirts and
hoodies three times too thick it is 1.8 to 2.0; below, the outline serves all the same."""
WEAK = 0.05
"""Factor on the outline's weight where it misleads: it hardly shapes the figure, and still tells frames that lie apart."""


def fit_unmisled(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                 progress: Callable[[int, int, str], None]) -> Fit:
    """Fits the clip; where outlines mislead, once more with little weight on them; arms stay where few frames fit the body."""
    fit = fit_with_doubt(body, sightings, outlines, config, progress)
    figure, clothes = np.split(fit.state.betas, [body.num_figure])
    thickest = max((cm for cm, name in zip(clothes, body.clothes, strict=True) if name not in NO_CLOTHES), default=0.0)
    loose, hides = is_mostly_loose(fit.iou), thickest >= THICK
    if loose or hides and np.sqrt(np.mean(figure**2)) > STRANGE:
        weak = replace(config, silhouette=WEAK * config.silhouette)
        fit = fit_with_doubt(body, sightings, outlines, weak, progress, arms_told=not loose)
    return replace(fit, notes=(*fit.notes, Finding.of(Code.CLOTHES_HIDE_SHAPE, figure=thickest))) if hides else fit
