"""Fewer gaussians that look like many: neighbours of one colour become one, pair by pair.

A pair costs what its mean colour differs from the two (Ward's criterion, weighted with the pixels that each shows), and its
distance. Nothing is left out: a merged gaussian covers what its two did, so that parts no frame shows keep their coverage.

The result is trained further. `stages/export/levels.py` merges by place alone, for avatars that were trained without levels: it has
neither frames to weigh colours with nor training afterwards.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from gsac.avatar.binding import Bound, FaceFrames, bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.mesh import distinct_pairs
from gsac.avatar.rotation import to_wxyz

NEIGHBOURS = 8
EVEN = 0.06
"""Difference of colour that costs as much as the width of a mean gaussian between the two: plain parts thin out evenly."""
SAME_SIDE, SAME_PART = 0.5, 0.5
"""Least cosine between the normals of a pair's faces, and most difference of their skin weights: fingers stay apart."""
HIDDEN = 0.02
"""Of the mean: what a gaussian that no frame shows is taken to show."""
ROUND = 0.15
"""Share of the gaussians that a round of merging takes away, at most; then the neighbours are looked for anew."""
OPAQUE = 0.95
"""Opacity of a merged gaussian, at most."""


def merged(gaussians: Gaussians, shown: np.ndarray, size: int, body: Body, rest: np.ndarray) -> Gaussians:
    """`size` gaussians in the place of more, or as few as neighbours allow.

    shown: (N,) pixels that each adds to the images, or what they are worth; rest: (V, 3) m, the body that they are merged on.
    """
    frames = face_frames(rest, body.faces)
    shown = np.asarray(shown, np.float64) + HIDDEN * np.mean(shown)
    while len(gaussians) > size:
        bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
        pairs = cheapest(gaussians, bound, shown, frames.R[gaussians.face, :, 1], body)
        if not len(pairs):
            break
        pairs = pairs[:min(len(gaussians) - size, max(int(ROUND * len(gaussians)), 1))]
        gaussians, shown = joined(gaussians, bound, shown, pairs, frames)
    return gaussians


def cheapest(gaussians: Gaussians, bound: Bound, shown: np.ndarray, normals: np.ndarray, body: Body) -> np.ndarray:
    """(P, 2) neighbours, the cheapest pair first, no gaussian in two of them."""
    places = bound.means.astype(np.float64)
    near = cKDTree(places).query(places, k=min(NEIGHBOURS + 1, len(places)))[1][:, 1:]
    one, other = np.repeat(np.arange(len(places)), near.shape[1]), near.ravel()
    i, j = distinct_pairs(np.minimum(one, other), np.maximum(one, other), len(places))
    skin = skin_of(gaussians.face, body)
    fit = ((normals[i] * normals[j]).sum(1) > SAME_SIDE) & (0.5 * np.abs(skin[i] - skin[j]).sum(1) < SAME_PART)
    i, j = i[fit], j[fit]
    colour = ((gaussians.rgb[i].astype(np.float64) - gaussians.rgb[j]) ** 2).sum(1)
    apart = ((places[i] - places[j]) ** 2).sum(1) / max(areas(bound).mean(), 1e-12)
    cost = shown[i] * shown[j] / (shown[i] + shown[j]) * (colour + EVEN**2 * apart)
    free, chosen = np.ones(len(places), bool), []
    for at in np.argsort(cost, kind="stable").tolist():
        if free[i[at]] and free[j[at]]:
            free[i[at]] = free[j[at]] = False
            chosen.append(at)
    return np.stack([i[chosen], j[chosen]], 1)


def areas(bound: Bound) -> np.ndarray:
    """(N,) m2: product of the two longer axes."""
    return np.sort(bound.scales.astype(np.float64), 1)[:, 1:].prod(1)


def skin_of(face: np.ndarray, body: Body) -> np.ndarray:
    """(N, J) float32, the skin weights of the faces' first corners."""
    corner = np.asarray(body.faces)[face, 0]
    out = np.zeros((len(face), len(body.parents)), np.float32)
    np.add.at(out, (np.arange(len(face))[:, None], body.skin_index[corner]), body.skin_weight[corner])
    return out


def joined(gaussians: Gaussians, bound: Bound, shown: np.ndarray, pairs: np.ndarray,
           frames: FaceFrames) -> tuple[Gaussians, np.ndarray]:
    """Each pair as one gaussian with the mean and the spread of both, as they show, bound as the one that shows more; and what it
    shows."""
    first = shown[pairs[:, 0]] >= shown[pairs[:, 1]]
    keep, drop = np.where(first, *pairs.T), np.where(first, *pairs.T[::-1])
    mass, means = gaussians.opacity * areas(bound), bound.means.astype(np.float64)
    share = (shown[keep] / (shown[keep] + shown[drop]))[:, None]
    middle = share * means[keep] + (1 - share) * means[drop]
    spread = np.zeros((len(keep), 3, 3))
    for one, part in ((keep, share), (drop, 1 - share)):
        axes = bound.rotations[one].astype(np.float64) * bound.scales[one][:, None]
        off = means[one] - middle
        spread += part[..., None] * (axes @ axes.transpose(0, 2, 1) + off[:, :, None] * off[:, None])
    square, axes = np.linalg.eigh(spread)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    scales = np.sqrt(np.maximum(square, 1e-12))
    needed = (mass[keep] + mass[drop]) / (scales[:, 1] * scales[:, 2])

    out = gaussians[np.arange(len(gaussians))]
    R, T, k = frames.R[out.face[keep]], frames.T[out.face[keep]], np.maximum(frames.k[out.face[keep], None], 1e-9)
    out.mu[keep] = np.einsum("nji,nj->ni", R, middle - T) / k
    out.quat[keep] = to_wxyz(Rotation.from_matrix(R.transpose(0, 2, 1) @ axes).as_quat())
    out.log_scale[keep] = np.log(scales / k)
    out.opacity[keep] = np.minimum(needed, OPAQUE)
    out.rgb[keep] = share * gaussians.rgb[keep] + (1 - share) * gaussians.rgb[drop]
    shown = shown.copy()
    shown[keep] += shown[drop]
    left = np.setdiff1d(np.arange(len(out)), drop)
    return out[left], shown[left]
