"""Gaussians that no frame shows from their front are laid flat on their neighbours' surface, in colours of what is seen around.

The images do not constrain them, and training would leave them as fur at edges and ragged soles.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import Bound, FaceFrames, bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import FLATNESS, Gaussians
from gsac.stages.train.gaussians.around_limbs import hold_colours, mix_colours, stretch
from gsac.stages.train.gaussians.disc_area import divisible_areas
from gsac.stages.train.gaussians.nearest import find_nearest
from gsac.stages.train.gaussians.shown import find_evidence, find_place

NEIGHBOURS = 8
"""Seen gaussians that an unseen one takes its height after, and its colour where they lie beside it."""
RING, COVER = 6, 0.6
"""Gaussians about one, and the share of the way to the last of them at which discs leave no gap."""
BESIDE, FAR = 0.01, 0.03
"""m to the nearest seen gaussian, up to which colours go on as they are there, and from which on they are those around the limb."""
APART = 3
"""Standard deviations that a widened gaussian stays off all that lies less than FAR from a seen one: outlines do not fray."""


def flatten_unseen(gaussians: Gaussians, seen: np.ndarray, rest: np.ndarray, faces: np.ndarray) -> Gaussians:
    """The gaussians, unseen ones as flat discs that cover the body, no higher over it than their neighbours.

    Opacity stays: it is learned from the masks. seen: (N,) bool; rest: (V, 3) m; faces: (F, 3).
    """
    poor, known = np.flatnonzero(~seen), np.flatnonzero(seen)
    if not len(poor) or not len(known):
        return gaussians
    frames = face_frames(rest, faces)
    size, middle = np.maximum(frames.k[gaussians.face], 1e-9), frames.T[gaussians.face]
    near = known[find_nearest(middle[known], middle[poor], NEIGHBOURS)]
    out = gaussians[np.arange(len(gaussians))]
    height = np.median(size[near] * gaussians.mu[near, 1], axis=1) / size[poor]
    out.mu[poor, 1] = np.minimum(gaussians.mu[poor, 1], height)
    means = bind(frames, out.face, out.mu, out.quat, out.log_scale).means
    widths = np.sort(gaussians.log_scale, 1)[:, 1:].mean(1) + np.log(size)
    width = np.minimum(np.median(widths[near], axis=1), widths[poor])
    width = np.maximum(width, np.log(covering_widths(means, poor, known))) - np.log(size[poor])
    out.log_scale[poor] = np.stack([width, width + np.log(FLATNESS), width], 1)
    out.quat[poor] = [1, 0, 0, 0]
    return out


def covering_widths(means: np.ndarray, poor: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(M,) m, standard deviations at which gaussians leave no gap between them, less near seen ones: an outline stays as it is.

    means: (N, 3) m at rest; poor: (M,) the unseen; known: (K,) the seen.
    """
    spacing = np.linalg.norm(means[find_nearest(means, means[poor], RING + 1)[:, -1]] - means[poor], axis=1)
    away = np.linalg.norm(means[known[find_nearest(means[known], means[poor], 1)[:, 0]]] - means[poor], axis=1)
    return np.maximum(np.minimum(COVER * spacing, (away - FAR) / APART), 1e-9)


def colour_unseen(gaussians: Gaussians, pixels: np.ndarray, seen: np.ndarray, rest: np.ndarray, body: Body) -> np.ndarray:
    """(N, 3) colours, those of unseen gaussians as what is seen beside them, farther off mixed of what is seen around the limb.

    pixels: (N,) `front_pixels`, mean over the frames; seen: (N,) bool; rest: (V, 3) m.
    """
    poor, known = np.flatnonzero(~seen), np.flatnonzero(seen)
    if not len(poor) or not len(known):
        return gaussians.rgb
    frames = face_frames(rest, body.faces)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    beside = known[find_nearest(bound.means[known], bound.means[poor], NEIGHBOURS)]
    out = gaussians[np.arange(len(gaussians))]
    out.rgb[poor] = gaussians.rgb[beside].mean(1)
    out.rgb[poor] = hold_colours(out, poor, beside, frames.R[:, :, 1])
    away = np.linalg.norm(bound.means[beside[:, 0]] - bound.means[poor], axis=1)
    far = away > BESIDE
    share = np.minimum((away[far] - BESIDE) / (FAR - BESIDE), 1)[:, None]
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
