"""Planted feet: soles rest on the floor while the body turns over them, then step after it one at a time.

World: y up, the person turns about the origin. Legs by inverse kinematics of two bones, the knee over the toes.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.joints import INDEX

STEPS = 8
"""Steps of each foot in a full turn."""
SWING = 0.4
"""Share of the time between two steps that a foot is in the air."""
LIFT = 0.06
"""m, height of a step."""
BEND = 0.005
"""m by which the hips are lower than on straight legs."""


def plant_feet(pose: np.ndarray, joints: np.ndarray, yaw: np.ndarray, place: np.ndarray, turns: np.ndarray) -> None:
    """Sets hips, knees and ankles of pose (T, 55, 3), in place.

    joints: (55, 3) m, T-pose; yaw: (T,) rad; place: (T, 2) m, world x and z of the pelvis;
    turns: (T, 3, 3), the pelvis' rotation in the world.
    """
    pelvis = joints[INDEX["pelvis"]]
    legs = {side: [joints[INDEX[f"{side}_{part}"]] for part in ("hip", "knee", "ankle")] for side in ("left", "right")}
    stance = {side: _find_stance(pose[0], leg, pelvis, side) for side, leg in legs.items()}
    height = min(_reach(leg, stance[side][1], pelvis) for side, leg in legs.items()) - BEND
    for (side, leg), phase in zip(legs.items(), (0.0, 0.5), strict=True):
        foot, rise = _steps(yaw, phase)
        out, ankle = stance[side]
        for t in range(len(pose)):
            about = Rotation.from_euler("y", foot[t]).as_matrix()
            target = about @ [ankle[0], 0, ankle[1]] + [0, rise[t], 0]
            hip = np.array([place[t, 0], height, place[t, 1]]) + turns[t] @ (leg[0] - pelvis)
            toes = about @ Rotation.from_euler("y", out).as_matrix()
            thigh, shank = _two_bones(leg, hip, target, toes[:, 2])
            local = turns[t].T @ thigh, thigh.T @ shank, shank.T @ toes
            for part, turn in zip(("hip", "knee", "ankle"), local, strict=True):
                pose[t, INDEX[f"{side}_{part}"]] = Rotation.from_matrix(turn).as_rotvec()


def _find_stance(pose: np.ndarray, leg: list, pelvis: np.ndarray, side: str) -> tuple[float, np.ndarray]:
    """A foot in the A-pose: its outward turn, rad, and x and z (2,) m of its ankle from the pelvis."""
    hip = Rotation.from_rotvec(pose[INDEX[f"{side}_hip"]])
    ankle = leg[0] - pelvis + hip.apply(leg[2] - leg[0])
    return float(pose[INDEX[f"{side}_hip"], 1]), ankle[[0, 2]]


def _reach(leg: list, ankle: np.ndarray, pelvis: np.ndarray) -> float:
    """Height of the pelvis over the ankle, m, with this leg straight at the farthest point of a step."""
    upper, lower = np.linalg.norm(leg[1] - leg[0]), np.linalg.norm(leg[2] - leg[1])
    away = leg[0][[0, 2]] - pelvis[[0, 2]] - Rotation.from_euler("z", np.pi / STEPS).as_matrix()[:2, :2] @ ankle
    return float(np.sqrt((upper + lower) ** 2 - away @ away) - (leg[0] - pelvis)[1])


def _steps(yaw: np.ndarray, phase: float) -> tuple[np.ndarray, np.ndarray]:
    """The foot's yaw (T,) rad, which waits and then catches up with the body, and its height (T,) m."""
    at = yaw / (2 * np.pi) * STEPS + phase
    share = np.clip((at % 1 - (1 - SWING)) / SWING, 0, 1)
    swung = share * share * (3 - 2 * share)
    return (np.floor(at) + swung - phase + (1 - SWING) / 2) * 2 * np.pi / STEPS, LIFT * np.sin(np.pi * share) ** 2


def _two_bones(leg: list, hip: np.ndarray, ankle: np.ndarray, forward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (3, 3) of thigh and shank in the world that reach from hip (3,) to ankle (3,), knee towards `forward` (3,)."""
    upper, lower = np.linalg.norm(leg[1] - leg[0]), np.linalg.norm(leg[2] - leg[1])
    way = ankle - hip
    length = min(np.linalg.norm(way), 0.9995 * (upper + lower))
    along = way / np.linalg.norm(way)
    front = forward - along * (along @ forward)
    front /= np.linalg.norm(front)
    near = (upper**2 - lower**2 + length**2) / (2 * length)
    knee = hip + along * near + front * np.sqrt(max(upper**2 - near**2, 0.0))
    hinge = np.cross(front, along)
    return tuple(_axes(end - start, hinge) @ _axes(bone, np.array([1.0, 0, 0])).T
                 for start, end, bone in ((hip, knee, leg[1] - leg[0]), (knee, hip + along * length, leg[2] - leg[1])))


def _axes(bone: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """(3, 3) columns: along the bone, the hinge orthogonal to it, and their cross product."""
    bone = bone / np.linalg.norm(bone)
    hinge = hinge - bone * (bone @ hinge)
    hinge = hinge / np.linalg.norm(hinge)
    return np.stack([bone, hinge, np.cross(bone, hinge)], 1)
