"""`smplx.method brought`: the poses that the user brings are the result; nothing is fitted but what the file lacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.initial import estimate_start
from gsac.stages.smplx.lm.joint_sigma import estimate_sigma
from gsac.stages.smplx.sightings import Sightings, focal_prior
from gsac.stages.smplx.silhouette import Outline, sample_outlines
from gsac.stages.smplx.start.begin import NEAREST, POINTS, describe, lay_out, locate, place
from gsac.stages.smplx.state import Fit, to_params


def take_as_fit(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                progress: Callable[[int, int, str], None]) -> Fit:
    """The brought poses as the fit. The file's translation holds where it gives the body's shape too, for a body of another shape
    stands elsewhere, and puts it before the camera; otherwise it is solved from the seen points."""
    start, center, focal = sightings.start, sightings.center, focal_prior(sightings, config)[0]
    assert start is not None, "SmplxConfig.check asks for it"
    ours = estimate_start(body, sightings, focal, center)
    state = lay_out(start, ours)
    solved = place(body, sightings, state, focal, center).transl
    transl = np.where(np.isfinite(solved), solved, ours.transl)
    if start.betas is not None:
        placed = np.isfinite(start.transl).all(1, keepdims=True) & (start.transl[:, 2:] > NEAREST)
        transl = np.where(placed, start.transl, transl)
    state = replace(state, transl=transl, stance=np.zeros(0))
    iou = sample_outlines(body, to_params(body, state, center), sightings.width, sightings.height, outlines)[1]
    x = locate(body, state) + transl[:, None]
    off = np.linalg.norm(focal * x[..., :2] / x[..., 2:] + center - sightings.xy[:, POINTS], axis=-1)
    off = np.where(sightings.seen[:, POINTS], off, np.nan)
    reprojection = np.array([np.nanmedian(o) if np.isfinite(o).any() else np.nan for o in off])
    progress(1, 1, "rounds")
    return Fit(state, estimate_sigma(body, sightings, state, config, center), iou, reprojection, 0,
               notes=describe(~start.given, np.zeros(len(transl), bool)))
