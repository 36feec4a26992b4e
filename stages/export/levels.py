"""Coarser levels of detail for an avatar that was trained without: clusters on one bone become one gaussian with their moments.

This is not the merge of `train` (`stages/train/gaussians/merge.py`), which weighs colours by the pixels that frames show and is
trained further afterwards. Here are neither frames nor training: a merged gaussian must look right at once, so it takes the
members' moments and the colour of the outermost ones.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.rotation import to_wxyz

MEMBERS = (3, 9)
"""Number of gaussians that become one, level by level."""
FACING = 0.05
"""Half the distance, m, that opposite normals add between two gaussians: front and back must not become one."""
UNDER = 0.01
"""Depth, m, under the cluster's outermost gaussian at which a colour counts a third: others cover it."""
LEAST_SCALE = 1e-4
"""Least standard deviation along an axis of a merged gaussian, m."""


def merge_level(avatar: RiggedAvatar, members: int) -> Gaussians:
    """Fewer gaussians than the avatar's, about one for each `members` of them.

    Mean, covariance, colour and covered area are those of the members together, in the rest pose.
    """
    g = avatar.gaussians
    frames = face_frames(avatar.vertices.astype(np.float64), avatar.faces)
    bound = bind(frames, g.face, g.mu, g.quat, g.log_scale)
    cluster, count = _cluster(avatar, bound.means, frames.R[g.face, :, 1], members)

    area = np.sort(bound.scales, axis=1)[:, 1:].prod(1)
    height = g.mu[:, 1] * frames.k[g.face]
    top = np.full(count, -np.inf)
    np.maximum.at(top, cluster, height)
    hidden = np.exp((height - top[cluster]) / UNDER)
    weight = np.maximum(g.opacity * area, 1e-12)
    total = np.bincount(cluster, weight, count)

    def mean(values: np.ndarray, weight: np.ndarray = weight) -> np.ndarray:
        flat = np.c_[values.reshape(len(values), -1), np.ones(len(values))] * weight[:, None]
        sums = np.stack([np.bincount(cluster, column, count) for column in flat.T], 1)
        return (sums[:, :-1] / sums[:, -1:]).reshape(count, *values.shape[1:])

    centre = mean(bound.means)
    off = bound.means - centre[cluster]
    half = bound.rotations * bound.scales[:, None]
    covariance = mean(half @ half.transpose(0, 2, 1) + off[:, :, None] * off[:, None, :])
    variances, axes = np.linalg.eigh(covariance)
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]
    scales = np.sqrt(np.maximum(variances, LEAST_SCALE ** 2))

    # the heaviest member's face carries it; its frame was valid, or it would have no area
    order = np.lexsort((weight, cluster))
    face = g.face[order[np.r_[np.flatnonzero(np.diff(cluster[order])), len(order) - 1]]]
    R, k = frames.R[face], np.maximum(frames.k[face], 1e-6)
    quat = Rotation.from_matrix(R.transpose(0, 2, 1) @ axes).as_quat()
    return Gaussians(
        face=face.astype(np.int32),
        mu=(np.einsum("nji,nj->ni", R, centre - frames.T[face]) / k[:, None]).astype(np.float32),
        quat=to_wxyz(quat).astype(np.float32),
        log_scale=np.log(scales / k[:, None]).astype(np.float32),
        rgb=mean(g.rgb, weight * hidden).astype(np.float32),
        opacity=np.clip(total / scales[:, 1:].prod(1), 0, 1).astype(np.float32),
        light=g.light, low_pass=g.low_pass,
    )


def _cluster(avatar: RiggedAvatar, means: np.ndarray, normals: np.ndarray, members: int) -> tuple[np.ndarray, int]:
    """means, normals: (N, 3). Returns the cluster (N,) of each gaussian, 0..count - 1, and the count.

    The gaussians of each bone are halved along their widest axis until a cluster has at most `members`.
    """
    corners = avatar.faces[avatar.gaussians.face]
    load = np.zeros((len(corners), len(avatar.joints)))
    for corner in corners.T:
        for joint, weight in zip(avatar.skin_index[corner].T, avatar.skin_weight[corner].T, strict=True):
            load[np.arange(len(corners)), joint] += weight
    bone = load.argmax(1)
    place = np.concatenate([means, FACING * normals], 1)
    cluster, count = np.empty(len(bone), np.int64), 0
    waiting = [np.flatnonzero(bone == j) for j in np.unique(bone)]
    while waiting:
        these = waiting.pop()
        if len(these) <= members:
            cluster[these] = count
            count += 1
            continue
        axis = np.ptp(place[these], axis=0).argmax()
        these = these[np.argsort(place[these, axis], kind="stable")]
        pieces = -(-len(these) // members)
        cut = len(these) * (pieces // 2) // pieces
        waiting += [these[cut:], these[:cut]]
    return cluster, count
