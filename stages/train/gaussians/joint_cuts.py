"""Long gaussians that would stand off the body where a joint bends: cut in two, each half on a face of its own.

A gaussian that lies along a straight arm may reach past the elbow, and its end stands off as a spike once the elbow bends. Two
halves look like the whole in the clip's poses, and each bends with the surface below it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsac.avatar.binding import FaceFrames, bind, unbind
from gsac.avatar.body import Body
from gsac.avatar.gaussians import FIELDS, Gaussians
from gsac.avatar.joints import INDEX
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.config import FULL_SIZE
from gsac.stages.train.gaussians.bends import Placed
from gsac.stages.train.gaussians.joint_faces import BentFaces, bind_anew, face_weights, faces_around, hold_at_joints
from gsac.stages.train.gaussians.joint_strays import Bent, BentSilhouettes

EXTENT = 2.0
"""Standard deviations from the middle of a gaussian to its ends."""
OFF, OFF_LIMB = 0.02, 0.011
"""m farther off the body than in the usual pose that an end of one of `FULL_SIZE` gaussians may be in a bend, on the trunk and on
forearms and lower legs, which are thin and seen before what is behind them; fewer are wider."""
LIMB = [INDEX[f"{side}_{name}"] for side in ("left", "right") for name in ("elbow", "wrist", "knee", "ankle")]
ON_LIMB = 0.25
"""Joints that move these, and the least skin weight of a face on them."""
OUTWARD = 0.5
"""Cosine between the body's normal and the way to an end from which on it is outside."""
SHORTEST, FAINT = 0.006, 0.05
"""m, longest axis, and opacity of gaussians that stay whole."""
ROUNDS = 2
MOST = 0.02
"""Gaussians at most that are cut, of all: those whose ends rise most."""
APART, LENGTH, WIDTH = 0.55, 0.6, 0.967
"""Of the whole's standard deviation: from its middle to those of the halves, and a half's along the cut axis and across."""
THINNED = 0.77, 0.11
"""Opacity of a half: the whole's times the first, and its square times the second. Halves of these numbers have the whole's alpha
but for 1.3 to 1.7 % of its squares (least squares for opacities of .3 to .95)."""


class Cut(NamedTuple):
    gaussians: Gaussians
    source: np.ndarray
    """(N,) indices of the gaussians that they are, or that they are halves of."""


def uncut(most: int) -> int:
    """Gaussians that become at most so many once they are cut."""
    return int(most / (1 + MOST))


def cut_at_joints(gaussians: Gaussians, carried: BentFaces, seen: BentSilhouettes) -> Cut:
    """The gaussians, those in halves that stand off most where joints bend. carried, seen: the body in the same bends."""
    out, source, room = gaussians, np.arange(len(gaussians)), int(MOST * len(gaussians))
    allowed = find_allowed(carried.body) * max(1.0, FULL_SIZE / max(len(gaussians), 1)) ** 0.5
    looked_at = source
    for _ in range(ROUNDS):
        size = np.exp(out.log_scale[looked_at]).max(1) * seen.usual.frames.k[out.face[looked_at]]
        looked_at = looked_at[(size > SHORTEST) & (out.opacity[looked_at] > FAINT)]
        excess = find_rise(out[looked_at], seen, allowed.min()) / allowed[out.face[looked_at]]
        worst = looked_at[np.argsort(-excess, kind="stable")[:min(room, np.count_nonzero(excess > 1))]]
        if not len(worst):
            break
        looked_at = np.append(worst, np.arange(len(out), len(out) + len(worst)))
        halves = halve(out[worst], carried)
        out, source, room = out[np.append(np.arange(len(out)), worst)], np.append(source, source[worst]), room - len(worst)
        for name in FIELDS:
            getattr(out, name)[looked_at] = getattr(halves, name)
    return Cut(out, source)


def find_allowed(body: Body) -> np.ndarray:
    """(F,) m, `OFF` or `OFF_LIMB` by what each face is on."""
    return np.where(face_weights(body)[:, LIMB].sum(1) > ON_LIMB, OFF_LIMB, OFF)


def find_rise(gaussians: Gaussians, seen: BentSilhouettes, least: float) -> np.ndarray:
    """(N,) m that an end of each gaussian stands farther off the body than in the usual pose, in the bend that is worst; any number
    up to `least` where it is no more than that.
    """
    usual = seen.usual
    ends = find_ends(gaussians, usual.frames)
    vertex, before = usual.tree.query(ends)[1], find_height(ends, usual)

    def rise(bent: Bent, _: Workspace) -> np.ndarray:
        there, surface = find_ends(gaussians, bent.surface.frames), bent.surface
        height = np.zeros(there.shape[:2])
        far = np.linalg.norm(there - surface.tree.data[vertex], axis=-1) > least  # the nearest vertex is no farther than this one
        height[far] = find_height(there[far], surface)
        return (height - before).max(1)

    return np.max(side_by_side(rise, seen.bent), 0)


def find_ends(gaussians: Gaussians, frames: FaceFrames) -> np.ndarray:
    """(N, 4, 3) m, both ends of each gaussian's two longest axes."""
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    longest = np.argsort(-bound.scales, 1)[:, :2]
    axes = EXTENT * np.take_along_axis(bound.rotations * bound.scales[:, None], longest[:, None], 2).transpose(0, 2, 1)
    return np.concatenate([bound.means[:, None] + axes, bound.means[:, None] - axes], 1)


def find_height(places: np.ndarray, surface: Placed) -> np.ndarray:
    """(...) m from the body to places (..., 3) m outside of it; 0 inside."""
    away, vertex = surface.tree.query(places)
    over = ((places - surface.tree.data[vertex]) * surface.normals[vertex]).sum(-1)
    return np.where(over > OUTWARD * away, away, 0)


def halve(gaussians: Gaussians, carried: BentFaces) -> Gaussians:
    """One half of each of N gaussians, cut across its longest axis, then the N others; each on the face that carries it best."""
    at, count = carried.usual.frames, len(gaussians)
    halves = gaussians[np.tile(np.arange(count), 2)]
    bound = bind(at, halves.face, halves.mu, halves.quat, halves.log_scale)
    each, longest, thinnest = np.arange(2 * count), bound.scales.argmax(1), bound.scales.argmin(1)
    length, thin = bound.scales[each, longest], bound.scales[each, thinnest]
    bound.means[:] += (np.repeat([-APART, APART], count) * length)[:, None] * bound.rotations[each, :, longest]
    bound.scales[:] *= WIDTH
    bound.scales[each, thinnest], bound.scales[each, longest] = thin, LENGTH * length
    halves.mu, halves.quat, halves.log_scale = unbind(at, halves.face, bound)
    halves.opacity *= THINNED[0] + THINNED[1] * halves.opacity
    return hold_at_joints(bind_anew(halves, find_nearest_face(halves.face, bound.means, carried), bound, at), carried)


def find_nearest_face(face: np.ndarray, places: np.ndarray, carried: BentFaces) -> np.ndarray:
    """(N,) faces nearest to places (N, 3) m in the usual pose, of the part and the side of face (N,)."""
    at, body = carried.usual.frames, carried.body
    near, fits = faces_around(Workspace().share, face, places, at, face_weights(body), carried.rest[body.faces])
    away = np.linalg.norm(at.T[near] - places[:, None], axis=2)
    return near[np.arange(len(near)), np.where(fits, away, np.inf).argmin(1)]
