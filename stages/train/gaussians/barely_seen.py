"""Colours of places that few frames show, or only at a slant: held to what the frames show well around them.

There a gaussian's colour answers for few pixels, often beneath others, and training may leave it anywhere. The pixels that a
gaussian shows of its front say how firmly it keeps its own colour; how well the frames show its place says how much the colours
around it count. Between seen and unseen there is no step.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix

from gsac.avatar.binding import FaceFrames, bind
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians.around_limbs import hold_colours
from gsac.stages.train.gaussians.disc_area import divisible_areas
from gsac.stages.train.gaussians.nearest import find_nearest_among
from gsac.stages.train.gaussians.shown import AROUND, find_evidence, find_place
from gsac.stages.train.poses.bundle_adjust import conjugate_gradients

NEIGHBOURS = 9
"""Gaussians whose colours are held alike, itself the first."""
FAINT = 0.1
"""Evidence at which a gaussian is half in doubt."""
PULL = 0.02
"""What the colour of one neighbour weighs where nothing is seen of both, over what a seen gaussian's own does in the median."""
LEAST_ALIKE = 0.05
"""Share of that weight between gaussians that face away from each other: round a limb's edge colours go on."""
UNLIKE = 0.2
"""Distance between two colours, sigma, over which they count as of one cloth: what is unlike its neighbour stays unlike."""
HELD, SURE = 0.2, 0.4
"""Evidence up to which a colour stays within those around it, and from which on it is free, and one of those if it is shown so."""
FREE = 1e-6
"""What even an unseen gaussian's own colour weighs, likewise: where nothing around is seen, it stays."""


def hold_barely_seen(gaussians: Gaussians, pixels: np.ndarray, seen: np.ndarray, frames: FaceFrames) -> np.ndarray:
    """(N, 3) colours in 0..1, those of barely seen places held to what was well seen around.

    pixels: (N,) `front_pixels`, mean over the clip's frames; seen: (N,) bool; frames: of all faces at rest.
    """
    if not seen.any():
        return gaussians.rgb
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    near, alike = find_place(bound.means, frames.R[gaussians.face, :, 1])
    areas = divisible_areas(bound)
    evidence = find_evidence(pixels, areas, seen, near, alike)
    out = gaussians[np.arange(len(gaussians))]
    own = np.where(seen, pixels / max(float(np.median(pixels[seen])), 1e-12), 1)  # the unseen were laid in colours of their cloth
    out.rgb = spread_colours(gaussians.rgb, own, evidence, near[:, :NEIGHBOURS], alike[:, :NEIGHBOURS])
    shown = pixels / areas
    sure = np.flatnonzero(seen & (evidence >= SURE) & (shown >= SURE * np.median(shown[seen])))
    poor = np.flatnonzero(evidence < SURE)
    if len(sure) and len(poor):
        around = find_nearest_among(bound.means, sure, poor, AROUND)
        held = hold_colours(out, poor, around, frames.R[:, :, 1])
        share = np.clip((SURE - evidence[poor]) / (SURE - HELD), 0, 1)[:, None]
        out.rgb[poor] = np.where(share < 1, out.rgb[poor] + share * (held - out.rgb[poor]), held)
    return out.rgb


def spread_colours(rgb: np.ndarray, own: np.ndarray, evidence: np.ndarray, near: np.ndarray, alike: np.ndarray) -> np.ndarray:
    """(N, 3) float32 colours that differ least, in squares, from rgb (N, 3) by `own` and from their neighbours' by doubt.

    own: (N,) weight; evidence: (N,) of the place; near: (N, K) neighbours; alike: (N, K) cosine between the normals.
    """
    doubt = 1 / (1 + (evidence / FAINT) ** 2)
    one, other = np.repeat(np.arange(len(rgb)), near.shape[1]), near.ravel()
    cloth = np.exp(-((rgb[one] - rgb[other]).astype(np.float64) ** 2).sum(1) / (2 * UNLIKE**2))
    weight = PULL * cloth * doubt[one] * doubt[other] * np.clip(alike.ravel(), LEAST_ALIKE, 1)
    pairs = coo_matrix((weight, (one, other)), shape=(len(rgb), len(rgb))).tocsr()
    pairs = (pairs + pairs.T) / 2
    own = own.astype(np.float64) + FREE
    diagonal = own + np.asarray(pairs.sum(1)).ravel()
    even = 1 / np.sqrt(diagonal)[:, None]  # unknowns of one scale need few steps
    solved = conjugate_gradients(lambda z: z - even * (pairs @ (even * z)), even * own[:, None] * rgb)
    return np.clip(even * solved, 0, 1).astype(np.float32)
