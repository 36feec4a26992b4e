"""Gaussians that a bent joint would swing off the surface: bound to a face nearby that carries them along with it.

While training, a gaussian may come to lie beside its face. In the poses of the clip that does not show; where a joint bends, the
face turns, shears and grows otherwise than the surface below the gaussian, and swings it out as a fringe. A clip of a turning
person bends no joint, so bent ones are sampled. Where the clip's usual pose has the gaussian, it stays.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.binding import Bound, FaceFrames, bind, face_frames, unbind
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.light import shade
from gsac.avatar.rotation import about_y
from gsac.avatar.skinning import joint_transforms
from gsac.stages.train.poses.poses import Poses

BENDS = (
    {"elbow": (0, -115, 0)},
    {"shoulder": (0, 0, 60), "collar": (0, 0, 15)},
    {"shoulder": (0, -80, 0)},
    {"shoulder": (0, 0, 0)},
    {"shoulder": (-60, 0, 0), "elbow": (0, -100, 0)},
    {"shoulder": (45, 0, -50), "elbow": (0, -100, 0)},
    {"hip": (-100, 15, 12), "knee": (120, 0, 0), "spine1": (15, 0, 0)},
    {"hip": (20, 0, 0), "knee": (115, 0, 0)},
    {"hip": (0, 0, 30), "wrist": (0, 0, 50), "neck": (0, 40, 0), "ankle": (-30, 0, 0)},
    {"wrist": (0, 0, -50), "neck": (25, 0, 0), "spine2": (20, 0, 0), "ankle": (30, 0, 0)},
)
"""What is bent in each sampled pose; the other joints stay as the clip has them."""
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


def hold_at_joints(gaussians: Gaussians, poses: Poses, frames: np.ndarray) -> Gaussians:
    """The gaussians, some bound to other faces. frames: (n,) trained ones, whose median pose leaves each where it is."""
    body, (rest, joints) = poses.body, poses.rest(int(frames[0]))

    def carry(pose: np.ndarray) -> tuple[np.ndarray, FaceFrames]:
        transforms = joint_transforms(pose[None], joints, body.parents)[0].astype(np.float32)
        return transforms, face_frames(body.bend(rest, joints, pose), body.faces)

    usual = np.median(poses.pose[frames], 0)
    usual[0] = 0
    transforms, at = carry(usual)
    bound = bind(at, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    near, fits = faces_around(gaussians.face, bound.means, at, rest, body)
    surface = Surface(bound.means, near, fits, at, transforms, body)
    width = np.sort(bound.scales, 1)[:, 1:].mean(1, keepdims=True)
    swing, bare = np.zeros(near.shape), np.zeros(near.shape)
    for turns in BENDS:
        bent, there = carry(turn_joints(usual, turns))
        swing += ((carried(bound.means, near, at, there) - surface.moved(bent)[:, None]) ** 2).sum(-1)
        grown = there.k[near] / np.maximum(at.k[near], 1e-9)
        bare += (BARE * width * np.maximum(grown[:, :1] - grown, 0)) ** 2
    best = np.where(fits, swing + bare, np.inf).argmin(1)
    own, new = (np.sqrt(each / len(BENDS)) for each in (swing[:, 0], swing[np.arange(len(swing)), best]))
    face = np.where((own > SWING) & (new < GAIN * own), near[np.arange(len(near)), best], gaussians.face).astype(np.int32)
    return bind_anew(gaussians, face, bound, at)


def faces_around(face: np.ndarray, places: np.ndarray, at: FaceFrames, rest: np.ndarray,
                 body: Body) -> tuple[np.ndarray, np.ndarray]:
    """(N, K) faces, each gaussian's own first, and (N, K) bool, which of them may carry it.

    face: (N,) own; places: (N, 3) m, and at: frames of the usual pose; rest: (V, 3) m.
    """
    a, b, c = rest[body.faces].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a))], 0)
    steady = np.flatnonzero(at.valid & (area > LEAST_AREA) & (area > SLENDER * longest))
    near = steady[KDTree(at.T[steady]).query(places, k=min(NEAR, len(steady)))[1].reshape(len(places), -1)]
    near = np.concatenate([face[:, None], near], 1)
    skinned = face_weights(body)
    apart = 0.5 * np.abs(skinned[near] - skinned[face][:, None]).sum(-1)
    alike = np.einsum("nki,ni->nk", at.R[near][..., 1], at.R[face][..., 1])
    fits = (apart < SAME_PART) & (alike > SAME_SIDE)
    fits[:, 0] = True
    return near, fits


def face_weights(body: Body) -> np.ndarray:
    """(F, J) float32, the skin weights of the faces' middles."""
    return np.asarray(body.weights, np.float32)[body.faces].mean(1)


class Surface:
    """The surface at N places, m, as linear blend skinning moves it: by the skin weights around, whatever a single face does."""

    def __init__(self, places: np.ndarray, near: np.ndarray, fits: np.ndarray, at: FaceFrames, transforms: np.ndarray, body: Body):
        """places: (N, 3) m; near, fits: of `faces_around`; at, transforms (J, 3, 4): of the pose in which the places are."""
        away = np.where(fits, ((places[:, None] - at.T[near]) ** 2).sum(-1), np.inf)
        share = np.exp(-(away - away.min(1, keepdims=True)) / (2 * BLUR**2))
        weight = np.einsum("nk,nkj->nj", share / share.sum(1, keepdims=True), face_weights(body)[near])
        self.weight = weight.astype(np.float64)
        blended = self.blend(transforms)
        self.rest = np.linalg.solve(blended[:, :, :3], (places - blended[:, :, 3])[..., None])[..., 0]

    def blend(self, transforms: np.ndarray) -> np.ndarray:
        """(N, 3, 4) of the places. transforms: (J, 3, 4) of the joints."""
        return np.tensordot(self.weight, transforms, 1)

    def moved(self, transforms: np.ndarray) -> np.ndarray:
        """(N, 3) m, the places in another pose. transforms: (J, 3, 4) of its joints."""
        blended = self.blend(transforms)
        return np.einsum("nab,nb->na", blended[:, :, :3], self.rest) + blended[:, :, 3]


def carried(places: np.ndarray, near: np.ndarray, at: FaceFrames, bent: FaceFrames) -> np.ndarray:
    """(N, K, 3) m, places (N, 3) of one pose as each of the faces near (N, K) carries them to another. at, bent: both frames."""
    local = np.einsum("nkji,nkj->nki", at.R[near], places[:, None] - at.T[near])
    grown = bent.k[near] / np.maximum(at.k[near], 1e-9)
    return np.einsum("nkij,nkj->nki", bent.R[near], local) * grown[..., None] + bent.T[near]


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
