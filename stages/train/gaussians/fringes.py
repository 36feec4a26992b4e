"""Gaussians that would hang off the person's own surface where a joint bends: made smaller while they are still trained.

Clothes stand off the body, so the surface that counts is the one that the gaussians around a place make. What the frames miss of
those that shrink, the steps that follow win back, which the end of a training could not (`joint_strays`).
"""

from __future__ import annotations

import cv2
import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise
from gsac.stages.train.gaussians.joint_strays import Bent, Side, find_reach, find_stray, place
from gsac.stages.train.gaussians.nearest import find_nearest
from gsac.stages.train.judge.novel_poses import turn_before_camera
from gsac.stages.train.poses.poses import Poses

BENDS = (
    {"shoulder": (0, 0, 0)},
    {"shoulder": (0, 0, 60), "collar": (0, 0, 15)},
    {"shoulder": (0, -80, 0), "elbow": (0, -80, 0)},
    {"hip": (-100, 15, 12), "knee": (120, 0, 0)},
)
"""What is bent in each sampled pose: shoulders above all, since hanging arms hide armpits; the rest stays as in the clip."""
TURNS = 4
"""Sides that each pose is looked at from."""
OFF = 0.006
"""m off that surface from which alpha begins to count."""
LEAST = 3e-5
"""Stray alpha of a gaussian in a bent pose, over the silhouettes' area, that is too much."""
GROWN = 0.005
"""m farther from the body than in the clip's usual pose that a gaussian has to reach there: what stands off anyway stays."""
ROUNDS, SHRUNK = 3, 0.6
"""Rounds that shrink what hangs off, and the factor of one on its standard deviations."""
AROUND, ALIKE = 16, 0.3
"""Gaussians whose median height is the surface at a vertex, and the least cosine between their normals and its own."""


def trim_fringes(gaussians: Gaussians, poses: Poses, frames: np.ndarray) -> Gaussians:
    """The gaussians, some smaller. frames: (n,) trained ones, whose median pose is the usual one."""
    (rest, joints), faces = poses.rest(int(frames[0])), poses.body.faces
    pose = np.median(poses.pose[frames], 0)
    pose[0] = 0
    shells = rest, clothe(gaussians, rest, faces)
    usual = place(poses.body.bend(rest, joints, pose), faces)

    def look(turns: dict, _: Workspace) -> Bent:
        return see(*(poses.body.bend(shell, joints, turn_joints(pose, turns)) for shell in shells), faces)

    left = side_by_side(look, BENDS)
    out = gaussians[np.arange(len(gaussians))]

    def find_large(posed: Bent, workspace: Workspace) -> np.ndarray:
        stray = sum((find_stray(out, side, faces, workspace, OFF) for side in posed.sides), np.zeros(len(out)))
        large = np.flatnonzero(stray > LEAST)
        return large[find_reach(out[large], posed.surface) > find_reach(out[large], usual) + GROWN]

    for _ in range(ROUNDS):
        found = side_by_side(find_large, left)
        out.log_scale[np.unique(np.concatenate(found)).astype(np.intp)] += np.float32(np.log(SHRUNK))
        left = [posed for posed, large in zip(left, found, strict=True) if len(large)]
        if not left:
            break
    return out


def clothe(gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) float32 m, the body's vertices on the surface that the gaussians make. rest: (V, 3) m; faces: (F, 3)."""
    frames = face_frames(rest, faces)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    up, own = frames.R[gaussians.face, :, 1], vertex_normals(rest, faces)
    thick = np.linalg.norm(np.einsum("ni,nij->nj", up, bound.rotations) * bound.scales, axis=1)
    top = np.einsum("ni,ni->n", bound.means - frames.T[gaussians.face], up) + thick
    near = find_nearest(frames.T[gaussians.face], rest, AROUND)
    tops = np.ma.masked_array(top[near], np.einsum("vki,vi->vk", up[near], own) < ALIKE)
    return (rest + np.ma.median(tops, axis=1).filled(0)[:, None] * own).astype(np.float32)


def see(bare: np.ndarray, clothed: np.ndarray, faces: np.ndarray) -> Bent:
    """The posed body from all sides, and how far off its clothes each pixel lies. bare, clothed: (V, 3) m; faces: (F, 3)."""
    sides = []
    for side in range(TURNS):
        both, camera, metre = turn_before_camera(np.concatenate([bare, clothed]), 360 * side / TURNS)
        vertices, shell = np.split(both, 2)
        person = (rasterise(vertices, faces, camera)[0] >= 0) | (rasterise(shell, faces, camera)[0] >= 0)
        away = cv2.distanceTransform((~person).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) / metre
        sides.append(Side(vertices, camera, away, max(int(np.count_nonzero(person)), 1)))
    return Bent(place(bare, faces), sides)
