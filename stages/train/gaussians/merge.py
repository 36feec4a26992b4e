"""Merges neighbouring gaussians of similar colour, pair by pair, to fewer that look alike.

A pair's cost is the difference of colours it loses (Ward's criterion, weighted by the pixels that each shows) plus its distance.
No gaussian is dropped, and a merged one covers the area of both as far as its opacity goes. Gaps that open all the same are closed
by training where frames show them, elsewhere by `unseen.cover_unseen`.

The result is trained further. `stages/export/levels.py` merges by place alone, for avatars that were trained without levels: it has
neither frames to weigh colours with nor training afterwards.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import Bound, FaceFrames, bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.nearest_rotation import nearest_quaternions
from gsac.stages.train.gaussians.disc_area import disc_areas
from gsac.stages.train.gaussians.merge_kernels import join_spreads, place_joined, take_free, weigh_pairs
from gsac.stages.train.gaussians.nearest import find_nearest

NEIGHBOURS = 8
"""Nearest gaussians that each may merge with."""
EVEN = 0.06
"""Difference of colour that costs as much as a distance of one mean gaussian's width: plain parts thin out evenly."""
SAME_SIDE, SAME_PART = 0.5, 0.5
"""Least cosine between the normals of a pair's faces, and largest difference of their skin weights: fingers stay apart."""
HIDDEN = 0.02
"""Pixels added to each gaussian's, as a share of their mean: those that no frame shows have a cost, too."""
ROUND = 0.15
"""Largest share of the gaussians that a round of merging takes away; then the neighbours are searched anew."""
OPAQUE = 0.95
"""Largest opacity of a merged gaussian."""
LIKELY = 4
"""Pairs, for each one to be merged, among which these are looked for first: sorting the cheapest takes less than sorting all."""


def merge_to_size(gaussians: Gaussians, seen: np.ndarray, shown: np.ndarray, size: int, body: Body,
                  rest: np.ndarray) -> tuple[Gaussians, np.ndarray]:
    """Merges to `size` gaussians, or to as few as neighbours allow; also tells which are seen: those made of one that is.

    seen: (N,) bool; shown: (N,) pixels that each adds to the images, possibly weighted; rest: (V, 3) m, the body that they are
    merged on. Returns M gaussians, (M,) bool.
    """
    frames, skin = face_frames(rest, body.faces), skin_weights(np.arange(len(body.faces)), body)
    shown = np.asarray(shown, np.float64) + HIDDEN * np.mean(shown)
    while len(gaussians) > size:
        bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
        most = min(len(gaussians) - size, max(int(ROUND * len(gaussians)), 1))
        pairs = find_cheapest_pairs(gaussians, bound, shown, frames, skin, most)
        if not len(pairs):
            break
        left, gaussians, shown = merge_pairs(gaussians, bound, shown, pairs, frames)
        seen = _join_pairs(seen, pairs)[left]
    return gaussians, seen


def _join_pairs(seen: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(N,) bool, of both of a pair whether one of them is seen. seen: (N,) bool; pairs: (P, 2)."""
    out = seen.copy()
    out[pairs] |= seen[pairs[:, ::-1]]
    return out


def find_cheapest_pairs(gaussians: Gaussians, bound: Bound, shown: np.ndarray, frames: FaceFrames, skin: np.ndarray,
                        most: int) -> np.ndarray:
    """(P, 2) neighbours to merge, at most `most`, the cheapest pair first, no gaussian in two pairs.

    bound, frames: gaussians and faces at rest; shown: (N,) pixels; skin: (F, J) `skin_weights` of all faces.
    """
    places = bound.means.astype(np.float64)
    near = find_nearest(places, places, NEIGHBOURS + 1)[:, 1:]
    size = max(disc_areas(bound.scales).mean(), 1e-12)
    pairs, cost = weigh_pairs(near, gaussians.face, frames.R, skin, gaussians.rgb, places, shown, size, SAME_SIDE, SAME_PART, EVEN)
    likely = LIKELY * most
    while True:
        tried = np.flatnonzero(cost <= np.partition(cost, likely)[likely]) if likely < len(cost) else np.arange(len(cost))
        taken = take_free(pairs, tried[np.argsort(cost[tried], kind="stable")], most, np.ones(len(places), np.bool_))
        if len(taken) == most or len(tried) == len(cost):
            return taken
        likely *= LIKELY


def skin_weights(face: np.ndarray, body: Body) -> np.ndarray:
    """(N, J) float32, the skin weights of the faces' first corners. face: (N,) of the gaussians."""
    corner = np.asarray(body.faces)[face, 0]
    out = np.zeros((len(face), len(body.parents)), np.float32)
    np.add.at(out, (np.arange(len(face))[:, None], body.skin_index[corner]), body.skin_weight[corner])
    return out


def merge_pairs(gaussians: Gaussians, bound: Bound, shown: np.ndarray, pairs: np.ndarray,
                frames: FaceFrames) -> tuple[np.ndarray, Gaussians, np.ndarray]:
    """Merges each of pairs (P, 2) to one gaussian with the mean and spread of both, on the face of the one that shows more.

    bound, frames: gaussians and faces at rest; shown: (N,) pixels, by which the two are weighted. Returns the indices
    (M,) of the gaussians that are left, merged or not, M gaussians, (M,) pixels.
    """
    first = shown[pairs[:, 0]] >= shown[pairs[:, 1]]
    keep, drop = np.where(first, *pairs.T), np.where(first, *pairs.T[::-1])
    share = shown[keep] / (shown[keep] + shown[drop])
    middle, spread = np.empty((len(keep), 3)), np.empty((len(keep), 3, 3))
    join_spreads(keep, drop, share, bound.means.astype(np.float64), bound.rotations, bound.scales, middle, spread)
    square, axes = np.linalg.eigh(spread)
    scales = np.sqrt(np.maximum(square, 1e-12))
    mass = gaussians.opacity * disc_areas(bound.scales)
    needed = (mass[keep] + mass[drop]) / (scales[:, 1] * scales[:, 2])

    stays = np.ones(len(gaussians), bool)
    stays[drop] = False
    left, at = np.flatnonzero(stays), (np.cumsum(stays) - 1)[keep]
    out, local = gaussians[left], np.empty_like(axes)
    place_joined(out.face, at, middle, axes, scales, frames.R, frames.T, frames.k, out.mu, local, out.log_scale)
    out.quat[at] = nearest_quaternions(local)
    out.opacity[at] = np.minimum(needed, OPAQUE)
    out.rgb[at] = share[:, None] * gaussians.rgb[keep] + (1 - share[:, None]) * gaussians.rgb[drop]
    summed = shown[left]
    summed[at] += shown[drop]
    return left, out, summed
