"""Puts a motion of another skeleton on the avatar's joints. The viewer's retarget.js follows the same rules, step by step.

1. Joints are found by name (`names.py`); hips and chest are where the legs and the arms meet, the spine is between them.
2. The reference is the file's rest pose, or, where that is no standing person (bones that all point one way), the frame
   most similar to the T-pose. There the avatar's joints are aligned with the source's: torso, neck and head upright, limbs
   and fingers along the source's bones by the smallest turn from the parent, feet in the source's direction. The remaining
   rotation between a source joint and ours is a constant of the joint.
3. In every frame our rotation in the world is the source's times that constant. Joints without a source follow their parent.
4. The source's up axis becomes +y, its first frame faces +z at the origin; lengths are scaled by the legs'; the feet's lowest
   place (2nd percentile over time) is the floor.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.motion import quat
from gsac.avatar.motion.names import match
from gsac.avatar.motion.source import Motion, MotionError, Source

NEEDED = [f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "shoulder", "elbow")]
LIMBS = [(f"{side}_{a}", f"{side}_{b}") for side in ("left", "right")
         for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))]
"""Bones that are aligned with the source's."""
SPINE = ("spine1", "spine2", "spine3")
STANDS = 0.4
"""Least mean cosine between the limbs of a reference and the T-pose's: hanging arms give 0.5."""
REFERENCES = 64
"""Number of frames that are candidates for the reference."""
UPRIGHT = 0.7
"""Least cosine between the torso's mean direction and an axis of the source's world, for that axis to be up."""
FLOOR_SHARE = 0.02
"""Share of the frames whose feet may lie under the floor."""


def retarget(source: Source, joint_names: list[str], parents: np.ndarray, joints: np.ndarray, where: str = "motion") -> Motion:
    """The motion on the avatar's joint_names (J), parents (J,) and joints (J, 3) at rest, m. where: the file in messages.

    Raises `MotionError` where the source's skeleton is not a person's.
    """
    ours = {name: np.asarray(place, float) for name, place in zip(joint_names, joints, strict=True)}
    found, torso = _match_joints(source, where)
    rest_turns, rest_places = _reference(source, found, torso, ours)
    laid, up = _lay_bones(rest_places, found, torso, ours)

    def follow(at: int, turn: np.ndarray) -> np.ndarray:
        """Our joint's rotation in the world (T, 4), which is `turn` (4,) while the source's joint `at` is as in the reference."""
        return quat.multiply(source.turns[:, at], quat.multiply(quat.inverse(rest_turns[at]), turn))

    world = {name: follow(at, laid.get(name, laid["pelvis"])) for name, at in found.items() if name in ours}
    spine = [follow(at, laid["pelvis"]) for at in torso]
    world["pelvis"] = spine[0]
    for k, name in enumerate(SPINE, 1):
        place = k * (len(spine) - 1) / len(SPINE)
        below = min(int(place + 1e-9), max(len(spine) - 2, 0))
        world[name] = quat.mix(spine[below], spine[min(below + 1, len(spine) - 1)], place - below)

    upright = _upright(world["pelvis"], up)
    turns = np.empty((len(source.turns), len(ours), 4))
    rotation = np.empty((*turns.shape[:2], 3), np.float32)
    for j, (name, parent) in enumerate(zip(joint_names, parents, strict=True)):
        above = turns[:, parent] if parent >= 0 else np.broadcast_to(quat.IDENTITY, turns[:, 0].shape)
        turns[:, j] = quat.multiply(upright, world[name]) if name in world else above
        rotation[:, j] = quat.to_rotvec(quat.multiply(quat.inverse(above), turns[:, j]))

    hips = quat.rotate(upright, source.places[:, torso[0]]) * _scale(source, found, ours)
    return Motion(source.fps, rotation, _transl(hips, turns, list(joint_names), parents, joints))


def _match_joints(source: Source, where: str) -> tuple[dict[str, int], list[int]]:
    """Our joint -> index of the source's; indices of the source's torso from the hips to the chest."""
    found = match(source.names)
    missing = [name for name in NEEDED if name not in found]
    if missing:
        raise MotionError(f"{where}: no joint for {', '.join(missing)} among the {len(source.names)} of the skeleton "
                          f"({', '.join(source.names[:40])}); known are the names of Mixamo, CMU, SMPL, VRM, Rigify and Unreal")

    def line(at: int) -> list[int]:
        """The joint and all above it, root first."""
        out = []
        while at >= 0:
            out.append(at)
            at = int(source.parents[at])
        return out[::-1]

    def meeting(a: str, b: str) -> list[int]:
        shared = [x for x, y in zip(line(found[a]), line(found[b]), strict=False) if x == y]
        if not shared:
            raise MotionError(f"{where}: {a} and {b} belong to two skeletons; one is expected")
        return shared

    below, above = meeting("left_hip", "right_hip"), meeting("left_shoulder", "right_shoulder")
    hips = below[-1]
    if hips in above:
        return found, above[above.index(hips):]
    return found, [hips, *(at for at in above if at not in below)]


def _reference(source: Source, found: dict[str, int], torso: list[int],
               ours: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Turns (P, 4) and places (P, 3) of the pose in which the skeletons are aligned."""
    if _similarity_to_t_pose(source.rest_places, found, torso, ours) >= STANDS:
        return source.rest_turns, source.rest_places
    frames = np.unique(np.linspace(0, len(source.turns) - 1, REFERENCES).astype(int))
    best = max(frames, key=lambda k: _similarity_to_t_pose(source.places[k], found, torso, ours))
    return source.turns[best], source.places[best]


def _similarity_to_t_pose(places: np.ndarray, found: dict[str, int], torso: list[int], ours: dict[str, np.ndarray]) -> float:
    """Mean cosine between the limbs and those of the T-pose."""
    standing, _ = _standing(places, found, torso, ours)
    bones = [(places[found[b]] - places[found[a]], quat.rotate(standing, ours[b] - ours[a]))
             for a, b in LIMBS if a in found and b in found]
    return float(np.mean([x @ y / max(np.linalg.norm(x) * np.linalg.norm(y), 1e-12) for x, y in bones]))


def _standing(places: np.ndarray, found: dict[str, int], torso: list[int],
              ours: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (4,) from our axes to those of an upright person with joints at places (P, 3), and its up axis (3,)."""
    top = found.get("head", found.get("neck", torso[-1]))
    rise = places[top] - places[torso[0]]
    up = np.zeros(3)
    up[np.argmax(np.abs(rise))] = 1.0 if rise[np.argmax(np.abs(rise))] >= 0 else -1.0
    theirs = _facing({name: places[at] for name, at in found.items()}, up)
    return quat.multiply(theirs, quat.inverse(_facing(ours, np.array([0.0, 1.0, 0.0])))), up


def _facing(places: dict[str, np.ndarray], up: np.ndarray) -> np.ndarray:
    """Rotation (4,) that takes x to the person's left and y to up."""
    left = places["left_hip"] - places["right_hip"] + places["left_shoulder"] - places["right_shoulder"]
    left = left - (left @ up) * up
    if np.linalg.norm(left) < 1e-9:
        left = np.roll(up, 1)
    left = left / np.linalg.norm(left)
    return quat.from_columns(left, up, np.cross(left, up))


def _lay_bones(places: np.ndarray, found: dict[str, int], torso: list[int],
          ours: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Our joints' rotations (4,) in the source's world in the reference pose, where they differ from the pelvis', and up (3,)."""
    standing, up = _standing(places, found, torso, ours)
    laid = {"pelvis": standing}

    def align(a: str, b: str, start: np.ndarray) -> None:
        """Aligns our bone from a to b with the source's, by the smallest turn from `start`."""
        laid[a] = start
        if a in found and b in found and b in ours and np.linalg.norm(places[found[b]] - places[found[a]]) > 1e-9:
            here = quat.rotate(start, ours[b] - ours[a])
            laid[a] = quat.multiply(quat.between(here, places[found[b]] - places[found[a]]), start)

    for side in ("left_", "right_"):
        align(side + "hip", side + "knee", standing)
        align(side + "knee", side + "ankle", laid[side + "hip"])
        laid[side + "ankle"] = laid[side + "foot"] = _turn_bone(standing, up, (side + "ankle", side + "foot"), places, found, ours)
        align(side + "shoulder", side + "elbow", standing)
        align(side + "elbow", side + "wrist", laid[side + "shoulder"])
        align(side + "wrist", side + "middle1", laid[side + "elbow"])
        if side + "middle1" in found and side + "wrist" in found:
            palm = places[found[side + "middle1"]] - places[found[side + "wrist"]]
            laid[side + "wrist"] = _turn_bone(laid[side + "wrist"], palm, (side + "pinky1", side + "index1"), places, found, ours)
        for finger in ("index", "middle", "pinky", "ring", "thumb"):
            start = laid[side + "wrist"]
            for k in (1, 2):
                align(f"{side}{finger}{k}", f"{side}{finger}{k + 1}", start)
                start = laid[f"{side}{finger}{k}"]
            laid[f"{side}{finger}3"] = start
    return laid, up


def _turn_bone(start: np.ndarray, axis: np.ndarray, bone: tuple[str, str], places: np.ndarray, found: dict[str, int],
            ours: dict[str, np.ndarray]) -> np.ndarray:
    """`start` (4,) turned about an axis (3,) until our bone is as parallel to the source's as it can be."""
    a, b = bone
    if a not in found or b not in found or a not in ours or b not in ours or np.linalg.norm(axis) < 1e-9:
        return start
    axis = axis / np.linalg.norm(axis)
    here, there = quat.rotate(start, ours[b] - ours[a]), places[found[b]] - places[found[a]]
    here, there = here - (here @ axis) * axis, there - (there @ axis) * axis
    if min(np.linalg.norm(here), np.linalg.norm(there)) < 1e-9:
        return start
    return quat.multiply(quat.about(axis, np.arctan2(np.cross(here, there) @ axis, here @ there)), start)


def _upright(pelvis: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Rotation (4,) from the source's world to ours; pelvis: (T, 4) in the source's world; up: (3,)."""
    mean = quat.rotate(pelvis, np.array([0.0, 1.0, 0.0])).mean(0)
    axis = np.argmax(np.abs(mean))
    if abs(mean[axis]) >= UPRIGHT:
        up = np.eye(3)[axis] * np.sign(mean[axis])
    left = quat.rotate(pelvis[0], np.array([1.0, 0.0, 0.0]))
    left = left - (left @ up) * up
    if np.linalg.norm(left) < 0.3:  # it lies on its side: go by where the belly looks
        front = quat.rotate(pelvis[0], np.array([0.0, 0.0, 1.0]))
        left = np.cross(up, front)
    left = left / np.linalg.norm(left)
    return quat.inverse(quat.from_columns(left, up, np.cross(left, up)))


def _scale(source: Source, found: dict[str, int], ours: dict[str, np.ndarray]) -> float:
    """Length of our legs over the source's."""
    legs = [(a, b) for a, b in LIMBS if a in found and b in found and ("hip" in a or "knee" in a)]
    theirs = sum(np.linalg.norm(source.rest_places[found[b]] - source.rest_places[found[a]]) for a, b in legs)
    return float(sum(np.linalg.norm(ours[b] - ours[a]) for a, b in legs) / max(theirs, 1e-12))


def _transl(hips: np.ndarray, turns: np.ndarray, names: list[str], parents: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Translation (T, 3) float32, m, that moves the pelvis along hips (T, 3) from the origin, with the feet on the floor."""
    places = np.empty((*turns.shape[:2], 3))
    for j, parent in enumerate(parents):
        places[:, j] = joints[j] if parent < 0 else (
            places[:, parent] + quat.rotate(turns[:, parent], np.asarray(joints[j], float) - joints[parent]))
    transl = hips - joints[names.index("pelvis")]
    transl[:, [0, 2]] -= transl[0, [0, 2]]
    feet = [j for j, name in enumerate(names) if name.endswith(("_ankle", "_foot"))]
    lowest = np.sort((places[:, feet, 1] - np.asarray(joints)[feet, 1]).min(1) + transl[:, 1])
    transl[:, 1] -= lowest[int(FLOOR_SHARE * len(lowest))]
    return transl.astype(np.float32)
