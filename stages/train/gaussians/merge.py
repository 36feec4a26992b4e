"""Merges neighbouring gaussians of similar colour, pair by pair, to fewer that look alike.

A pair's cost is the difference of colours it loses (Ward's criterion, weighted by the pixels that each shows) plus its distance.
No gaussian is dropped: a merged one covers the area of both, so that parts no frame shows stay covered.

The result is trained further. `stages/export/levels.py` merges by place alone, for avatars that were trained without levels: it has
neither frames to weigh colours with nor training afterwards.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.binding import Bound, FaceFrames, bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.mesh import distinct_pairs
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.rotation import to_wxyz
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


def merge_to_size(gaussians: Gaussians, seen: np.ndarray, shown: np.ndarray, size: int, body: Body,
                  rest: np.ndarray) -> tuple[Gaussians, np.ndarray]:
    """Merges to `size` gaussians, or to as few as neighbours allow; also tells which are seen: those made of one that is.

    seen: (N,) bool; shown: (N,) pixels that each adds to the images, possibly weighted; rest: (V, 3) m, the body that they are
    merged on. Returns M gaussians, (M,) bool.
    """
    frames = face_frames(rest, body.faces)
    shown = np.asarray(shown, np.float64) + HIDDEN * np.mean(shown)
    while len(gaussians) > size:
        bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
        pairs = find_cheapest_pairs(gaussians, bound, shown, frames.R[gaussians.face, :, 1], body)
        if not len(pairs):
            break
        pairs = pairs[:min(len(gaussians) - size, max(int(ROUND * len(gaussians)), 1))]
        left, gaussians, shown = merge_pairs(gaussians, bound, shown, pairs, frames)
        seen = _join_pairs(seen, pairs)[left]
    return gaussians, seen


def _join_pairs(seen: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(N,) bool, of both of a pair whether one of them is seen. seen: (N,) bool; pairs: (P, 2)."""
    out = seen.copy()
    out[pairs] |= seen[pairs[:, ::-1]]
    return out


def find_cheapest_pairs(gaussians: Gaussians, bound: Bound, shown: np.ndarray, normals: np.ndarray, body: Body) -> np.ndarray:
    """(P, 2) neighbours to merge, the cheapest pair first, no gaussian in two pairs.

    bound: the gaussians at rest; shown: (N,) pixels; normals: (N, 3) of their faces.
    """
    places = bound.means.astype(np.float64)
    near = find_nearest(places, places, NEIGHBOURS + 1)[:, 1:]
    one, other = np.repeat(np.arange(len(places)), near.shape[1]), near.ravel()
    i, j = distinct_pairs(np.minimum(one, other), np.maximum(one, other), len(places))
    cost, size = np.empty(len(i)), max(areas(bound).mean(), 1e-12)
    _weigh_pairs(i, j, normals, skin_weights(gaussians.face, body), gaussians.rgb, places, shown, size, cost)
    fit = ~np.isinf(cost)
    i, j, cost = i[fit], j[fit], cost[fit]
    order = np.argsort(cost, kind="stable")
    return _take_free(i[order], j[order], np.ones(len(places), bool))


@own_kernel(nogil=True, error_model="numpy")
def _weigh_pairs(i, j, normals, skin, rgb, places, shown, size, cost):
    """cost (P,), written: of merging i (P,) with j (P,), infinite where they are not of one side and one part.

    normals: (N, 3); skin: (N, J) weights; rgb: (N, 3); places: (N, 3) m; shown: (N,) pixels; size: of a mean gaussian, m2.
    """
    for pair in range(len(i)):
        one, other = i[pair], j[pair]
        alike, colour, way, apart = np.float32(0), 0.0, 0.0, 0.0
        for c in range(3):
            alike += normals[one, c] * normals[other, c]
            colour += (np.float64(rgb[one, c]) - rgb[other, c]) ** 2
            way += (places[one, c] - places[other, c]) ** 2
        for joint in range(skin.shape[1]):
            apart += abs(skin[one, joint] - skin[other, joint])
        cost[pair] = np.inf
        if alike > SAME_SIDE and 0.5 * apart < SAME_PART:
            cost[pair] = shown[one] * shown[other] / (shown[one] + shown[other]) * (colour + EVEN**2 * (way / size))


@own_kernel(nogil=True)
def _take_free(i, j, free):
    """(M, 2) of the pairs i (P,), j (P,) in their order: those of which neither is in one taken before. free: (N,) all True."""
    taken, count = np.empty((len(i), 2), i.dtype), 0
    for pair in range(len(i)):
        if free[i[pair]] and free[j[pair]]:
            free[i[pair]] = free[j[pair]] = False
            taken[count] = i[pair], j[pair]
            count += 1
    return taken[:count]


def areas(bound: Bound) -> np.ndarray:
    """(N,) m2, product of the two longer axes."""
    return np.sort(bound.scales.astype(np.float64), 1)[:, 1:].prod(1)


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
    return left, out[left], shown[left]
