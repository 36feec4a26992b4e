"""Gaussians that no frame shows from their front are laid flat on their neighbours' surface, in colours of what is seen around.

The images do not constrain them, and training would leave them as fur at edges and ragged soles.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import Bound, FaceFrames, bind
from gsac.avatar.body import Body
from gsac.avatar.gaussians import FLATNESS, Gaussians
from gsac.stages.train.gaussians.around_limbs import hold_colours, mix_colours, stretch
from gsac.stages.train.gaussians.disc_area import divisible_areas
from gsac.stages.train.gaussians.nearest import find_nearest, find_nearest_among
from gsac.stages.train.gaussians.shown import find_evidence, find_place

NEIGHBOURS = 8
"""Seen gaussians that an unseen one takes its height after, and its colour where they lie beside it."""
RING, COVER = 6, 0.6
"""Gaussians about one, and the share of the way to the last of them at which discs leave no gap."""
EDGE = 3
"""Standard deviations at which a widened disc ends: there it meets the surface, below which its middle lies."""
PLACE, APART = 24, 0.004
"""Gaussians that tell how the surface bends at a place, and m between two from which on they tell it."""
SLIMMEST, WIDEST = 0.005, 0.15
"""m, the radii of a finger and of a flat back."""
BESIDE, FAR = 0.01, 0.03
"""m to the nearest seen gaussian: up to the first, colours and widths go on as they are there, since wide discs would fray an
outline; from the second on colours are those around the limb, and discs cover."""


def flatten_unseen(gaussians: Gaussians, seen: np.ndarray, frames: FaceFrames) -> Gaussians:
    """The gaussians, unseen ones as flat discs that cover the body, no higher over it than their neighbours.

    Opacity stays: it is learned from the masks. seen: (N,) bool; frames: of all faces at rest.
    """
    poor, known = np.flatnonzero(~seen), np.flatnonzero(seen)
    if not len(poor) or not len(known):
        return gaussians
    size, middle = np.maximum(frames.k[gaussians.face], 1e-9), frames.T[gaussians.face]
    near = find_nearest_among(middle, known, poor, NEIGHBOURS)
    out = gaussians[np.arange(len(gaussians))]
    height = np.median(size[near] * gaussians.mu[near, 1], axis=1) / size[poor]
    out.mu[poor, 1] = np.minimum(gaussians.mu[poor, 1], height)
    widths = disc_widths(gaussians, size)
    lay_discs(out, poor, np.minimum(np.median(widths[near], axis=1), widths[poor]) / size[poor])
    return cover_unseen(out, seen, frames)


def cover_unseen(gaussians: Gaussians, seen: np.ndarray, frames: FaceFrames) -> Gaussians:
    """The gaussians, those far from all that is seen as discs that leave no gap: what lies behind a limb shines through none.

    A wide disc would stand off a round limb. So it sinks, until its edge meets the surface. seen: (N,) bool; frames: of all
    faces at rest.
    """
    poor, known = np.flatnonzero(~seen), np.flatnonzero(seen)
    if not len(poor) or not len(known):
        return gaussians
    size = np.maximum(frames.k[gaussians.face], 1e-9)
    means = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale).means
    spacing = np.linalg.norm(means[find_nearest(means, means[poor], RING + 1)[:, -1]] - means[poor], axis=1)
    away = np.linalg.norm(means[find_nearest_among(means, known, poor, 1)[:, 0]] - means[poor], axis=1)
    radius = find_radii(frames.T[gaussians.face], frames.R[gaussians.face, :, 1], poor)
    width, own = far_share(away) * np.minimum(COVER * spacing, radius / EDGE), disc_widths(gaussians, size)[poor]
    wider = width > own
    poor, width, own, radius = poor[wider], width[wider], own[wider], radius[wider]
    out = gaussians[np.arange(len(gaussians))]
    out.mu[poor, 1] -= EDGE**2 * (width**2 - own**2) / (2 * radius) / size[poor]
    lay_discs(out, poor, width / size[poor])
    return out


def disc_widths(gaussians: Gaussians, size: np.ndarray) -> np.ndarray:
    """(N,) m, mean of each one's two largest standard deviations. size: (N,) m, `FaceFrames.k` of their faces."""
    return np.exp(np.sort(gaussians.log_scale, 1)[:, 1:].mean(1)) * size


def lay_discs(gaussians: Gaussians, which: np.ndarray, width: np.ndarray) -> None:
    """Makes some flat discs on their faces, in place. which: (M,) indices; width: (M,) standard deviation in units of the face."""
    width = np.log(width)
    gaussians.log_scale[which] = np.stack([width, width + np.log(FLATNESS), width], 1)
    gaussians.quat[which] = [1, 0, 0, 0]


def find_radii(places: np.ndarray, normals: np.ndarray, which: np.ndarray) -> np.ndarray:
    """(M,) m, radius of the surface where it bends most. places: (N, 3) m; normals: (N, 3) unit; which: (M,) of these."""
    near = find_nearest(places, places[which], PLACE)
    apart = np.linalg.norm(places[near] - places[which, None], axis=2)
    turned = np.linalg.norm(normals[near] - normals[which, None], axis=2)
    bends = np.where(apart > APART, turned / np.maximum(apart, APART), 0)
    return 1 / np.clip(bends.max(1), 1 / WIDEST, 1 / SLIMMEST)


def far_share(away: np.ndarray) -> np.ndarray:
    """(N,) from 0 beside what is seen to 1 far from it. away: (N,) m to the nearest seen gaussian."""
    return np.clip((away - BESIDE) / (FAR - BESIDE), 0, 1)


def colour_unseen(gaussians: Gaussians, pixels: np.ndarray, seen: np.ndarray, frames: FaceFrames, body: Body) -> np.ndarray:
    """(N, 3) colours, those of unseen gaussians as what is seen beside them, farther off mixed of what is seen around the limb.

    pixels: (N,) `front_pixels`, mean over the clip's frames; seen: (N,) bool; frames: of all faces at rest.
    """
    poor, known = np.flatnonzero(~seen), np.flatnonzero(seen)
    if not len(poor) or not len(known):
        return gaussians.rgb
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    beside = find_nearest_among(bound.means, known, poor, NEIGHBOURS)
    out = gaussians[np.arange(len(gaussians))]
    out.rgb[poor] = gaussians.rgb[beside].mean(1)
    out.rgb[poor] = hold_colours(out, poor, beside, frames.R[:, :, 1])
    away = np.linalg.norm(bound.means[beside[:, 0]] - bound.means[poor], axis=1)
    far = away > BESIDE
    share = far_share(away[far])[:, None]
    around = colour_far(gaussians, bound, pixels, seen, poor[far], frames, body)
    out.rgb[poor[far]] += share * (around - out.rgb[poor[far]])
    return out.rgb


def colour_far(gaussians: Gaussians, bound: Bound, pixels: np.ndarray, seen: np.ndarray, far: np.ndarray, frames: FaceFrames,
               body: Body) -> np.ndarray:
    """(M, 3) colours of unseen gaussians, far (M,), mixed of those seen around the limb, of well seen ones most.

    bound, frames: gaussians and faces at rest; pixels, seen: (N,) as in `colour_unseen`.
    """
    known, normals = np.flatnonzero(seen), frames.R[:, :, 1]
    areas, places = divisible_areas(bound), stretch(bound, gaussians.face, frames, body)
    evidence = find_evidence(pixels, areas, seen, *find_place(bound.means, normals[gaussians.face]))
    shown = pixels / areas
    trust = np.minimum(shown / max(float(np.median(shown[known])), 1e-12), 1) * np.minimum(evidence, 1)
    out = gaussians[np.arange(len(gaussians))]
    out.rgb[far], around = mix_colours(gaussians.rgb[known], trust[known], places[known], places[far])
    return hold_colours(out, far, known[around], normals)
