"""Removes bone drift: a constant turn of a bone, undone by its gaussians, is invisible in the clip. The body fit's is kept.

Poses that follow the images drift that way, and motion from elsewhere then draws the avatar bent. So bones are turned back, with
their gaussians and joints, until the fit's angles show the person where the refined ones do; the clip itself looks as before.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.binding import FaceFrames, bind, face_frames, unbind
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.skinning import joint_transforms, skin
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.poses.poses import Poses

BONES = BODY.stop
"""Bones that may drift: those of the body joints."""
POINTS, FRAMES = 800, 24
"""Points of the surface, and frames, that are compared."""
ROUNDS = 3
"""Of Gauss-Newton."""
TURN, MISS = 0.05, 1 / 560
"""Sigma of a bone's drift, rad, and of a point's place in the image, in focal lengths: a pixel of 540."""
MOST = 0.08
"""rad, largest drift: a bone that is turned farther was fitted wrong."""


class Drift(NamedTuple):
    """A drift of bones that was removed from the poses: where the body's faces were at rest, and where they are since."""

    turned: FaceFrames
    plain: FaceFrames

    def undo(self, gaussians: Gaussians) -> Gaussians:
        """The gaussians of the poses as they were, on the bones turned back."""
        g = gaussians
        mu, quat, log_scale = unbind(self.plain, g.face, bind(self.turned, g.face, g.mu, g.quat, g.log_scale))
        return replace(g, mu=mu, quat=quat, log_scale=log_scale)


def remove_drift(poses: Poses, trained: np.ndarray) -> Drift:
    """Turns the bones of `poses` back, in angles and joints. trained: (n,) indices of frames."""
    rest, joints = poses.rest(int(trained[0]))
    turns = find_drift(poses, trained, rest, joints)
    moved = joints.copy()
    for joint in range(1, len(joints)):
        parent = poses.body.parents[joint]
        moved[joint] = moved[parent] + turns[parent] @ (joints[joint] - joints[parent])
    transforms = np.concatenate([turns, (moved - np.einsum("jab,jb->ja", turns, joints))[..., None]], 2).astype(np.float32)
    turned = face_frames(skin(rest, transforms, poses.body.skin_index, poses.body.skin_weight), poses.body.faces)
    # new arrays: a copy of the poses may share the old ones
    poses.pose, poses.base_pose = (turn_back(pose, turns, poses.body.parents) for pose in (poses.pose, poses.base_pose))
    poses.joint_offset = poses.joint_offset + moved - joints
    return Drift(turned, face_frames(rest, poses.body.faces))


def turn_back(pose: np.ndarray, turns: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """(T, 55, 3) pose that looks as `pose` (T, 55, 3) did before turns (55, 3, 3) of the bones at rest. parents: (55,)."""
    local = rotation.exp(np.asarray(pose, np.float64))
    for joint in range(len(parents)):
        above = turns[parents[joint]] if parents[joint] >= 0 else np.eye(3)
        local[:, joint] = above @ local[:, joint] @ turns[joint].T
    return rotation.log(local)


def find_drift(poses: Poses, trained: np.ndarray, rest: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(55, 3, 3) rotation of each bone in the refined poses against the body fit, common to all frames.

    trained: (n,) indices of frames; rest: (V, 3) m; joints: (55, 3) m at rest.
    """
    body = poses.body
    frames = trained[::-(-len(trained) // FRAMES)]
    which = np.arange(0, len(rest), max(1, len(rest) // POINTS))
    levers = bone_levers(body, which, rest, joints)
    normals = vertex_normals(rest, body.faces)[which]
    own, fit = (world_rotations(body, angles[frames], joints)[:, :BONES] for angles in (poses.pose, poses.fit_pose))
    weight = np.asarray(body.weights)[which, :BONES]
    seen = sum_over_bones(own, weight[:, :, None] * normals[:, None])
    places = sum_over_bones(own, levers) + (poses.transl[frames] + joints[0])[:, None]
    facing = np.clip(-(seen * places).sum(2) / np.linalg.norm(places, axis=2), 0, 1)
    goal = places[..., :2] / places[..., 2:]
    turns, shift = np.tile(np.eye(3), (BONES, 1, 1)), (poses.transl - poses.fit_transl)[frames].mean(0)
    start = poses.fit_transl[frames] + joints[0] + shift
    known = np.diag(np.append(np.full(3 * BONES, (MISS / TURN) ** 2 * len(frames) * len(which) / BONES), np.zeros(3)))
    for _ in range(ROUNDS):
        hessian, gradient = known.copy(), known @ np.append(rotation.log(turns).ravel(), np.zeros(3))
        arms = np.einsum("jab,njb->nja", turns, levers)
        places = sum_over_bones(fit, arms) + start[:, None]
        for more, slope in chain(*side_by_side(partial(image_equations, fit, arms, places, goal, facing), range(len(frames)))):
            hessian += more
            gradient += slope
        move = np.linalg.solve(hessian, -gradient)
        turns = rotation.exp(move[:-3].reshape(BONES, 3)) @ turns
        start = start + np.einsum("tab,b->ta", fit[:, 0], move[-3:])
    turns = rotation.log(turns)
    turns = rotation.exp(turns * np.minimum(1, MOST / np.maximum(np.linalg.norm(turns, axis=1, keepdims=True), 1e-12)))
    for joint in range(BONES, len(joints)):
        turns = np.concatenate([turns, turns[None, body.parents[joint]]])
    return turns


def image_equations(fit: np.ndarray, arms: np.ndarray, places: np.ndarray, goal: np.ndarray, facing: np.ndarray, t: int,
                    _: Workspace) -> list[tuple[np.ndarray, np.ndarray]]:
    """Hessian (U, U) and gradient (U,) of half the weighted squares by which a frame's points miss, along each axis of its image.

    fit: (T, BONES, 3, 3) rotations; arms: (n, BONES, 3) m at rest; places: (T, n, 3) m, camera frame; goal: (T, n, 2) in focal
    lengths; facing: (T, n) weights; t: the frame's number among them.
    """
    z, both = places[t, :, 2], []
    for axis in range(2):
        image = places[t, :, axis] / z
        rows = slopes(fit[t, :, axis] - image[:, None, None] * fit[t, :, 2], arms) / z[:, None]
        both.append((rows.T @ (rows * facing[t, :, None]), rows.T @ ((image - goal[t, :, axis]) * facing[t])))
    return both


def sum_over_bones(turns: np.ndarray, levers: np.ndarray) -> np.ndarray:
    """(T, n, 3) sums over the bones of turns (T, BONES, 3, 3) times levers (n, BONES, 3)."""
    return levers.reshape(len(levers), -1) @ turns.swapaxes(2, 3).reshape(len(turns), -1, 3)


def slopes(covectors: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """(n, 3 BONES + 3) derivatives of the places along covectors by the bones' turns at rest and the pelvis' shift.

    covectors: (n, BONES, 3) in the axes of each bone; arms: (n, BONES, 3).
    """
    (x, y, z), (a, b, c) = np.moveaxis(arms, 2, 0), np.moveaxis(covectors, 2, 0)
    turned = np.stack([y * c - z * b, z * a - x * c, x * b - y * a], 2)
    return np.concatenate([turned.reshape(len(arms), -1), covectors[:, 0]], 1)


def bone_levers(body: Body, which: np.ndarray, rest: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(n, BONES, 3) m: a point's place relative to the pelvis is the sum of each bone's rotation times its lever.

    which: (n,) indices of vertices; rest: (V, 3) m; joints: (55, 3) m at rest.
    """
    weight = np.array(np.asarray(body.weights)[which], np.float64)
    levers = np.zeros((len(which), len(joints), 3))
    below = weight.copy()
    for joint in range(len(joints) - 1, 0, -1):
        parent = body.parents[joint]
        levers[:, joint] += weight[:, joint, None] * (rest[which] - joints[joint])
        levers[:, parent] += below[:, joint, None] * (joints[joint] - joints[parent])
        below[:, parent] += below[:, joint]
    levers[:, 0] += weight[:, 0, None] * (rest[which] - joints[0])
    for joint in range(len(joints) - 1, BONES - 1, -1):  # fingers and jaw as they hang on their wrist and head
        levers[:, body.parents[joint]] += levers[:, joint]
    return levers[:, :BONES]


def world_rotations(body: Body, pose: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(T, 55, 3, 3) rotations of the bones from rest. pose: (T, 55, 3) axis-angle; joints: (55, 3) m at rest."""
    return joint_transforms(np.asarray(pose, np.float64), joints, body.parents)[..., :3]
