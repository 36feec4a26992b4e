"""How the model lies in each bone, which images cannot tell: taken as the body fit has it.

A bone turned a little in all frames, and what is painted on it turned back, show the same clip. Poses that follow the images drift
that way, and angles that come from elsewhere then draw the avatar bent. So bones are turned back, with their gaussians and joints,
until the fit's angles show the clip's person where the refined ones do; the clip itself looks as before.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.binding import bind, face_frames, unbind
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.skinning import joint_transforms, skin
from gsac.stages.train.poses.poses import Poses

BONES = BODY.stop
POINTS, FRAMES = 800, 24
"""Of the surface and the clip, that are compared."""
ROUNDS = 3
TURN, MISS = 0.05, 1 / 560
"""rad that a bone is taken to have drifted, and by how much of the focal length points miss: a pixel of 540."""
MOST = 0.08
"""rad; what turns a bone farther was wrong with the fit."""


def taken_back(gaussians: list[Gaussians], poses: Poses, trained: np.ndarray) -> list[Gaussians]:
    """The gaussians on bones turned back; `poses` get the angles and joints to that. trained: indices of the frames."""
    rest, joints = poses.rest(int(trained[0]))
    turns = drift(poses, trained, rest, joints)
    moved = joints.copy()
    for joint in range(1, len(joints)):
        parent = poses.body.parents[joint]
        moved[joint] = moved[parent] + turns[parent] @ (joints[joint] - joints[parent])
    transforms = np.concatenate([turns, (moved - np.einsum("jab,jb->ja", turns, joints))[..., None]], 2).astype(np.float32)
    turned = face_frames(skin(rest, transforms, poses.body.skin_index, poses.body.skin_weight), poses.body.faces)
    plain = face_frames(rest, poses.body.faces)
    for pose in (poses.pose, poses.base_pose):
        pose[:] = turned_back(pose, turns, poses.body.parents)
    poses.joint_offset = poses.joint_offset + moved - joints
    out = []
    for g in gaussians:
        mu, quat, log_scale = unbind(plain, g.face, bind(turned, g.face, g.mu, g.quat, g.log_scale))
        out.append(Gaussians(g.face, mu, quat, log_scale, g.rgb, g.opacity, g.light))
    return out


def turned_back(pose: np.ndarray, turns: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """pose: (T, 55, 3); turns: (55, 3, 3) by which each bone is turned at rest. Returns the pose that then looks as before."""
    local = rotation.exp(np.asarray(pose, np.float64))
    for joint in range(len(parents)):
        above = turns[parents[joint]] if parents[joint] >= 0 else np.eye(3)
        local[:, joint] = above @ local[:, joint] @ turns[joint].T
    return rotation.log(local)


def drift(poses: Poses, trained: np.ndarray, rest: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(55, 3, 3) by which each bone is turned in the avatar, as the images see it, against the body fit."""
    body = poses.body
    frames = trained[::-(-len(trained) // FRAMES)]
    which = np.arange(0, len(rest), max(1, len(rest) // POINTS))
    levers = carried_levers(body, which, rest, joints)
    normals = vertex_normals(rest, body.faces)[which]
    own, fit = (world(body, angles[frames], joints)[:, :BONES] for angles in (poses.pose, poses.fit_pose))
    weight = np.asarray(body.weights)[which, :BONES]
    seen = summed(own, weight[:, :, None] * normals[:, None])
    places = summed(own, levers) + (poses.transl[frames] + joints[0])[:, None]
    facing = np.clip(-(seen * places).sum(2) / np.linalg.norm(places, axis=2), 0, 1)
    goal = places[..., :2] / places[..., 2:]
    turns, shift = np.tile(np.eye(3), (BONES, 1, 1)), (poses.transl - poses.fit_transl)[frames].mean(0)
    start = poses.fit_transl[frames] + joints[0] + shift
    known = np.diag(np.append(np.full(3 * BONES, (MISS / TURN) ** 2 * len(frames) * len(which) / BONES), np.zeros(3)))
    for _ in range(ROUNDS):
        hessian, gradient = known.copy(), known @ np.append(rotation.log(turns).ravel(), np.zeros(3))
        arms = np.einsum("jab,njb->nja", turns, levers)
        for t, place in enumerate(summed(fit, arms) + start[:, None]):
            z = place[:, 2]
            for axis in range(2):
                image = place[:, axis] / z
                rows = slopes(fit[t, :, axis] - image[:, None, None] * fit[t, :, 2], arms) / z[:, None]
                hessian += rows.T @ (rows * facing[t, :, None])
                gradient += rows.T @ ((image - goal[t, :, axis]) * facing[t])
        move = np.linalg.solve(hessian, -gradient)
        turns = rotation.exp(move[:-3].reshape(BONES, 3)) @ turns
        start = start + np.einsum("tab,b->ta", fit[:, 0], move[-3:])
    turns = rotation.log(turns)
    turns = rotation.exp(turns * np.minimum(1, MOST / np.maximum(np.linalg.norm(turns, axis=1, keepdims=True), 1e-12)))
    for joint in range(BONES, len(joints)):
        turns = np.concatenate([turns, turns[None, body.parents[joint]]])
    return turns


def summed(turns: np.ndarray, levers: np.ndarray) -> np.ndarray:
    """(T, n, 3) of turns (T, BONES, 3, 3) and levers (n, BONES, 3): sums over the bones of turn times lever."""
    return levers.reshape(len(levers), -1) @ turns.swapaxes(2, 3).reshape(len(turns), -1, 3)


def slopes(covectors: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """(n, 3 BONES + 3): how much farther places lie along covectors when the bones turn at rest and the pelvis moves.

    covectors: (n, BONES, 3) in the axes of each bone; arms: (n, BONES, 3).
    """
    (x, y, z), (a, b, c) = np.moveaxis(arms, 2, 0), np.moveaxis(covectors, 2, 0)
    turned = np.stack([y * c - z * b, z * a - x * c, x * b - y * a], 2)
    return np.concatenate([turned.reshape(len(arms), -1), covectors[:, 0]], 1)


def carried_levers(body, which: np.ndarray, rest: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(n, BONES, 3): a point's place from the pelvis is the sum of each bone's rotation times its lever."""
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


def world(body, pose: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """(T, 55, 3, 3) rotations from rest."""
    return joint_transforms(np.asarray(pose, np.float64), joints, body.parents)[..., :3]
