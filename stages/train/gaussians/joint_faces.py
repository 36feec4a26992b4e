"""Gaussians that a bent joint would swing off the surface: bound to a face nearby that carries them along with it.

While training, a gaussian may come to lie beside its face. In the poses of the clip that does not show; where a joint bends, the
face turns, shears and grows otherwise than the surface below the gaussian, and swings it out as a fringe. A clip of a turning
person bends no joint, so bent ones are sampled. Where the clip's usual pose has the gaussian, it stays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gsac.avatar.binding import Bound, FaceFrames, bind, face_frames, unbind
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.light import shade
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.rotation import about_y
from gsac.avatar.skinning import joint_transforms
from gsac.avatar.threads import Share, Workspace, side_by_side
from gsac.stages.train.gaussians.bends import BENDS, usual_pose
from gsac.stages.train.gaussians.nearest import find_nearest
from gsac.stages.train.poses.poses import Poses

SWING = 0.008
"""m, root mean square over the sampled poses, by which a gaussian may leave the surface that it lies on."""
GAIN = 0.8
"""Share of its own face's swing below which another face's is worth the change."""
BARE = 7.0
"""What a standard deviation that a face lets shrink more than the own one counts over a distance: a bent joint shall not tear."""
NEAR = 24
"""Faces around a gaussian that may carry it."""
SAME_PART, SAME_SIDE = 0.5, 0.5
"""Largest difference of skin weights between its own face and another that may carry it, and least cosine of the normals."""
LEAST_AREA, SLENDER = 4e-6, 0.12
"""m2, and area over the square of the longest side, below which a face carries nothing new: its frame is not steady."""
BLUR = 0.01
"""m, sigma over which the skin weights of faces count as those of the surface at a place."""
TURNS = 8
"""Turns of the person over which the light on a gaussian is averaged."""


class Posed(NamedTuple):
    """The body in one pose."""

    transforms: np.ndarray
    """(J, 3, 4) float32 of the joints."""
    frames: FaceFrames


class BentFaces(NamedTuple):
    """Joints and faces in the clip's usual pose and in its bends."""

    body: Body
    rest: np.ndarray
    """(V, 3) m."""
    usual: Posed
    bent: list[Posed]


def bend_faces(poses: Poses, frames: np.ndarray) -> BentFaces:
    """Joints and faces as `BENDS` have them. frames: (n,) trained ones, whose median pose is the usual one."""
    body, (rest, joints) = poses.body, poses.rest(int(frames[0]))
    usual = usual_pose(poses.pose, frames)

    def carry(pose: np.ndarray, _: Workspace) -> Posed:
        return Posed(joint_transforms(pose[None], joints, body.parents)[0].astype(np.float32),
                     face_frames(body.bend(rest, joints, pose), body.faces))

    posed, *bent = side_by_side(carry, [usual, *(turn_joints(usual, turns) for turns in BENDS)])
    return BentFaces(body, rest, posed, bent)


def hold_at_joints(gaussians: Gaussians, carried: BentFaces) -> Gaussians:
    """The gaussians where they are in the usual pose, some bound to the face that carries them best to the bent ones."""
    body, rest, usual, bent = carried
    share, at = Workspace().share, usual.frames
    bound = bind(at, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    skinned = face_weights(body)
    near, fits = faces_around(share, gaussians.face, bound.means, at, skinned, rest[body.faces])
    surface = Surface(share, bound.means, near, fits, usual, skinned)
    width = np.sort(bound.scales, 1)[:, 1:].mean(1)
    lost = np.zeros((*near.shape, 2))
    for there in bent:
        share(_add_losses, bound.means, width, near, *at[:3], *there.frames[:3], surface.moved(there.transforms), lost)
    swing, bare = lost[..., 0], lost[..., 1]
    best = np.where(fits, swing + bare, np.inf).argmin(1)
    own, new = (np.sqrt(each / len(bent)) for each in (swing[:, 0], swing[np.arange(len(swing)), best]))
    face = np.where((own > SWING) & (new < GAIN * own), near[np.arange(len(near)), best], gaussians.face).astype(np.int32)
    return bind_anew(gaussians, face, bound, at)


def faces_around(share: Share, face: np.ndarray, places: np.ndarray, at: FaceFrames, skinned: np.ndarray,
                 corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, K) faces, each gaussian's own first, and (N, K) bool, which of them may carry it.

    share: `Workspace.share`; face: (N,) own; places: (N, 3) m, and at: frames of the usual pose; skinned: (F, J) `face_weights`;
    corners: (F, 3, 3) m at rest.
    """
    a, b, c = corners.transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a))], 0)
    steady = np.flatnonzero(at.valid & (area > LEAST_AREA) & (area > SLENDER * longest))
    near = np.concatenate([face[:, None], steady[find_nearest(at.T[steady], places, NEAR)]], 1)
    fits = np.empty(near.shape, np.bool_)
    share(_find_fitting, near, at.R, skinned, fits)
    fits[:, 0] = True
    return near, fits


def face_weights(body: Body) -> np.ndarray:
    """(F, J) float32, the skin weights of the faces' middles."""
    return np.asarray(body.weights, np.float32)[body.faces].mean(1)


class Surface:
    """The surface at N places, m, as linear blend skinning moves it: by the skin weights around, whatever a single face does."""

    def __init__(self, share: Share, places: np.ndarray, near: np.ndarray, fits: np.ndarray, usual: Posed,
                 skinned: np.ndarray):
        """share: `Workspace.share`; places: (N, 3) m in the usual pose; near, fits: of `faces_around`; skinned: (F, J)
        `face_weights`.
        """
        self.weight = np.zeros((len(places), skinned.shape[1]))
        share(_blend_weights, places, near, fits, usual.frames.T, skinned, self.weight)
        blended = self.blend(usual.transforms)
        self.rest = np.linalg.solve(blended[:, :, :3], (places - blended[:, :, 3])[..., None])[..., 0]

    def blend(self, transforms: np.ndarray) -> np.ndarray:
        """(N, 3, 4) of the places. transforms: (J, 3, 4) of the joints."""
        return np.tensordot(self.weight, transforms, 1)

    def moved(self, transforms: np.ndarray) -> np.ndarray:
        """(N, 3) m, the places in another pose. transforms: (J, 3, 4) of its joints."""
        blended = self.blend(transforms)
        return np.einsum("nab,nb->na", blended[:, :, :3], self.rest) + blended[:, :, 3]


@own_kernel(nogil=True, error_model="numpy")
def _find_fitting(worker, workers, near, R, skinned, fits):
    """fits (N, K), written: which faces near (N, K) are of the part and the side of the first. R: (F, 3, 3); skinned: (F, J)."""
    count, joints = len(near), skinned.shape[1]
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        own = near[i, 0]
        for k in range(near.shape[1]):
            face, apart, alike = near[i, k], 0.0, 0.0
            for j in range(joints):
                apart += abs(skinned[face, j] - skinned[own, j])
            for c in range(3):
                alike += R[face, c, 1] * R[own, c, 1]
            fits[i, k] = 0.5 * apart < SAME_PART and alike > SAME_SIDE


@own_kernel(nogil=True, error_model="numpy")
def _blend_weights(worker, workers, places, near, fits, T, skinned, weight):
    """weight (N, J), added to: mean of the skin weights (F, J) of the faces near (N, K) that fit, by their distance."""
    count, faces = near.shape
    away = np.empty(faces)
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        least, total = np.inf, 0.0
        for k in range(faces):
            away[k] = 0.0
            for c in range(3):
                away[k] += (places[i, c] - T[near[i, k], c]) ** 2
            if fits[i, k]:
                least = min(least, away[k])
        for k in range(faces):
            away[k] = math.exp(-(away[k] - least) / (2 * BLUR**2)) if fits[i, k] else 0.0
            total += away[k]
        for k in range(faces):
            if fits[i, k]:
                for j in range(skinned.shape[1]):
                    weight[i, j] += away[k] / total * skinned[near[i, k], j]


@own_kernel(nogil=True, error_model="numpy")
def _add_losses(worker, workers, places, width, near, R, T, size, bent_R, bent_T, bent_size, surface, lost):
    """lost (N, K, 2), added to: squares, m2, of what the faces near (N, K) cost in a bent pose, off the surface and laid bare.

    places (N, 3) m, frames R (F, 3, 3), T (F, 3) m and size (F,): of the usual pose; width: (N,) m; the others: of the bent one;
    surface: (N, 3) m, the places there.
    """
    count = len(near)
    local = np.empty(3)
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        own_grown = 0.0
        for k in range(near.shape[1]):
            face = near[i, k]
            grown = bent_size[face] / max(size[face], 1e-9)
            if k == 0:
                own_grown = grown
            for c in range(3):
                local[c] = 0.0
                for d in range(3):
                    local[c] += R[face, d, c] * (places[i, d] - T[face, d])
            for c in range(3):
                carried = bent_T[face, c]
                for d in range(3):
                    carried += bent_R[face, c, d] * local[d] * grown
                lost[i, k, 0] += (carried - surface[i, c]) ** 2
            lost[i, k, 1] += (BARE * width[i] * max(own_grown - grown, 0.0)) ** 2


def bind_anew(gaussians: Gaussians, face: np.ndarray, bound: Bound, at: FaceFrames) -> Gaussians:
    """Binds the gaussians to face (N,) where they are; in the clip's light they keep their colours, averaged over the turn.

    bound, at: gaussians and faces in one pose.
    """
    moved = face != gaussians.face
    if not moved.any():
        return gaussians
    out = gaussians[np.arange(len(gaussians))]
    which = Bound(*(part[moved] for part in bound))
    out.face, (out.mu[moved], out.quat[moved], out.log_scale[moved]) = face, unbind(at, face[moved], which)
    if out.light is not None:
        before, after = (mean_shade(out.light, at.R[each[moved], :, 1]) for each in (gaussians.face, face))
        out.rgb[moved] = np.clip(gaussians.rgb[moved] * before / after, 0, 1)
    return out


def mean_shade(light: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) factors of the light on normals (N, 3), mean over a turn of the person. light: (4, 3) of `avatar.light`."""
    turns = (about_y(2 * np.pi * k / TURNS).astype(np.float32) for k in range(TURNS))
    return np.mean([shade(light, normals @ turn.T) for turn in turns], 0)
