"""More gaussians on mouth, eyes and brows, which are a few px in a frame of the whole person and which people look at from near."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body
from gsac.stages.train.gaussians.inner_faces import find_inner
from gsac.stages.train.gaussians.nearest import find_nearest

MOVES = 0.003
"""m by which an expression moves a feature."""
NEAR = 0.015
"""m about the features that are as dense; at twice that the density is that of the body."""
DENSER = 2.5
"""Density there, over that of the body."""


def density_on_head(body: Body, betas: np.ndarray) -> np.ndarray:
    """(F,) factors of the density of gaussians: none inside of the head, `DENSER` on facial features. betas: (up to B,)."""
    rest = body.rest(betas)[0]
    inner, centres = find_inner(rest, body.faces), rest[body.faces].mean(1)
    moves = np.linalg.norm(body.exprdirs, axis=1).max(1, initial=0)[body.faces].mean(1)
    density = np.where(inner, 0.0, 1.0)
    if (features := ~inner & (moves > MOVES)).any():
        away = np.linalg.norm(centres[features][find_nearest(centres[features], centres, 1)[:, 0]] - centres, axis=1)
        density *= 1 + (DENSER - 1) * np.clip(2 - away / NEAR, 0, 1)
    return density
