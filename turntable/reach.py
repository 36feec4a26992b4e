"""Reaching: turns collar, shoulder, elbow and wrist so that a hand lies where it should, and nothing of the arm lies in the body.

Points and directions are those of the left side, +x to the person's left, +z forward; the right side is their mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from gsac.avatar.joints import INDEX, LEFT_HAND, RIGHT_HAND, J
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.skinning import joint_transforms, skin
from gsac.turntable.person import Person

CHAIN = ("collar", "shoulder", "elbow", "wrist")
TOUCH = 0.004
"""m by which skin and cloth give way where an arm lies on them."""
FAR = 0.12
"""m from the surface beyond which a point is judged no more."""
HARD = (2.0, 12.0, 40.0)
"""Weights of depth in the body, one after the other: first the arm finds its way, then it keeps out."""
DEEP = 0.02
"""m beyond which an arm is stuck in the body, and the search begins anew farther off."""
AWAY = (0.0, 0.1, 0.2, 0.05)
"""m off the goal from which searches begin, each where the one before got stuck."""
SAMPLES = 400
"""Points of an arm that are kept out of the body."""


@dataclass(frozen=True)
class Goal:
    """Where a hand goes. Places are m from a joint in the T-pose of this person."""

    near: str
    """Joint that the place is told from."""
    place: tuple[float, float, float]
    """Of the knuckle of the middle finger."""
    fingers: tuple[float, float, float]
    """Direction from wrist to knuckles."""
    palm: tuple[float, float, float]
    """Direction that the palm faces."""
    elbow: tuple[float, float, float]
    """Place of the elbow from the shoulder, a hint."""
    curl: float = 0.2
    """Bend of each finger joint, rad."""
    under: bool = False
    """Whether the hand may lie under cloth and hair: only bare skin stops it."""

    def raised(self, away: float) -> Goal:
        """The goal `away` m before it is reached, on the palm's side."""
        off = np.asarray(self.place) - away * np.asarray(self.palm) / np.linalg.norm(self.palm)
        return Goal(self.near, tuple(off), self.fingers, self.palm, self.elbow, self.curl, False)


def reach(person: Person, start: np.ndarray, side: str, goal: Goal) -> np.ndarray:
    """Pose (55, 3) in which the hand is at its goal. start: (55, 3) axis-angle, root not turned; side: left or right."""
    flip = np.array([1.0, 1, 1]) if side == "left" else np.array([-1.0, 1, 1])
    joints, parents = person.joints, person.body.parents
    chain = [INDEX[f"{side}_{name}"] for name in CHAIN]
    elbow, hand, knuckle = chain[2], chain[3], INDEX[f"{side}_middle1"]
    start = curl_fingers(start, side, goal.curl)
    target = joints[INDEX[f"{side}_{goal.near}" if f"{side}_{goal.near}" in INDEX else goal.near]] + goal.place * flip
    fingers, palm = (unit(np.asarray(d) * flip) for d in (goal.fingers, goal.palm))
    bent = joints[chain[1]] + goal.elbow * flip
    arm = Arm(person, side)
    solid = Solid.around(person, start, side, goal.under)
    wrist = target - 0.09 * fingers
    hinge = np.array([0, 1.0, 0])

    def posed(x: np.ndarray) -> np.ndarray:
        out = start.copy()
        out[chain] = x.reshape(4, 3)
        return out

    def depths(x: np.ndarray) -> np.ndarray:
        return solid.depth(arm.place(joint_transforms(posed(x)[None], joints, parents)[0]))

    def residuals(x: np.ndarray, hard: float) -> np.ndarray:
        """Of the rotations x (12,): hand's place and directions, elbow's place, bends no joint can do, `hard` times the depth."""
        a = joint_transforms(posed(x)[None], joints, parents)[0]
        at = {j: a[j, :, :3] @ joints[j] + a[j, :, 3] for j in (hand, knuckle, elbow)}
        along, facing = unit(at[knuckle] - at[hand]), -a[hand, :, 1]
        rolled = x[6:9] - hinge * (x[6:9] @ hinge)
        return np.concatenate([
            (at[knuckle] - target) * 25, (along - fingers) * 0.8, (facing - palm) * 0.8, (at[elbow] - bent) * 4,
            x[:3] * 1.2, rolled * [0.25, 0, 1.0], x[9:] * [0.3, 0.5, 0.3], hard * solid.depth(arm.place(a))])

    ends: list[np.ndarray] = []
    for away in AWAY:
        aimed = aim_bones(joints, chain, start, bent - away * palm, wrist - away * palm)
        x = np.concatenate([start[chain[0]], aimed.ravel(), np.zeros(3)])
        for hard in HARD:
            x = least_squares(residuals, x, args=(hard,), diff_step=1e-3, max_nfev=40, ftol=1e-5).x
        ends.append(x)
        if depths(x).max() <= DEEP:
            return posed(x)
    return posed(min(ends, key=lambda x: depths(x).max()))


def curl_fingers(pose: np.ndarray, side: str, curl: float) -> np.ndarray:
    """(55, 3) axis-angle with the fingers of a side bent by `curl` rad at each joint. pose: (55, 3)."""
    out, sign = pose.copy(), 1.0 if side == "left" else -1.0
    for finger, share in (("index", 0.9), ("middle", 1.0), ("ring", 1.1), ("pinky", 1.15)):
        for k in (1, 2, 3):
            out[INDEX[f"{side}_{finger}{k}"]] = [0, 0, -sign * curl * share]
    return out


def aim_bones(joints: np.ndarray, chain: list[int], start: np.ndarray, elbow: np.ndarray, wrist: np.ndarray) -> np.ndarray:
    """(2, 3) axis-angle of shoulder and elbow that point the bones of the arm at places.

    joints: (55, 3) m, T-pose; start: (55, 3) axis-angle; elbow, wrist: (3,) m.
    """
    upper = turn_between(joints[chain[2]] - joints[chain[1]], elbow - joints[chain[1]])
    local = (Rotation.from_rotvec(start[chain[0]]).inv() * upper)
    lower = turn_between(joints[chain[3]] - joints[chain[2]], upper.inv().apply(wrist - elbow))
    return np.stack([local.as_rotvec(), lower.as_rotvec()])


def turn_between(a: np.ndarray, b: np.ndarray) -> Rotation:
    """The least rotation from direction a (3,) to direction b (3,)."""
    return Rotation.align_vectors(b[None], a[None])[0]


def unit(v: np.ndarray) -> np.ndarray:
    """Direction (3,) of v (3,)."""
    return v / max(np.linalg.norm(v), 1e-9)


class Arm:
    """Points of forearm, hand and lower half of the upper arm."""

    def __init__(self, person: Person, side: str):
        index, weight = person.skin_index, person.skin_weight
        main = leading_joints(person)
        shoulder = INDEX[f"{side}_shoulder"]
        low = (main == shoulder) & (np.linalg.norm(person.rest - person.joints[shoulder], axis=1) > 0.16)
        used = np.zeros(len(main), bool)
        used[np.unique(person.pair[np.unique(person.faces)])] = True
        here = np.flatnonzero(used & (np.isin(main, own_joints(side)) | low))
        here = here[:: max(1, len(here) // SAMPLES)]
        self.rest, self.index, self.weight = person.rest[here], index[here], weight[here]

    def place(self, transforms: np.ndarray) -> np.ndarray:
        """(K, 3) m. transforms: (55, 3, 4) of the joints."""
        return skin(self.rest, transforms.astype(np.float32), self.index, self.weight)


class Solid:
    """A surface that an arm may lie on but not in."""

    def __init__(self, points: np.ndarray, normals: np.ndarray):
        """points: (M, 3) m; normals: (M, 3), outward."""
        self.points, self.normals, self.tree = points, normals, KDTree(points)

    @classmethod
    def around(cls, person: Person, pose: np.ndarray, side: str, under: bool = False) -> Solid:
        """The person without the arm of a side. pose: (55, 3), root not turned; under: whether bare skin alone counts."""
        transforms = joint_transforms(pose[None], person.joints, person.body.parents)[0]
        bare, drawn = person.pose(transforms, np.zeros(len(person.body.expression_names)))
        main = leading_joints(person)
        points, faces, owner = (bare, person.body.faces, main[:len(bare)]) if under else (
            drawn, person.faces, main[person.pair[:, 0]])
        arm = [*own_joints(side), INDEX[f"{side}_shoulder"], INDEX[f"{side}_collar"]]
        used = np.zeros(len(points), bool)
        used[np.unique(faces)] = True
        keep = used & ~np.isin(owner, arm)
        return cls(points[keep], vertex_normals(points, faces)[keep])

    def depth(self, points: np.ndarray) -> np.ndarray:
        """(K,) m by which points (K, 3) lie deeper than `TOUCH` below the surface, 0 outside."""
        distance, nearest = self.tree.query(points, distance_upper_bound=FAR)
        near = np.isfinite(distance)
        at = np.asarray(nearest)[near]
        out = np.zeros(len(points))
        out[near] = np.clip(-((points[near] - self.points[at]) * self.normals[at]).sum(1) - TOUCH, 0, None)
        return out


def leading_joints(person: Person) -> np.ndarray:
    """(C,) joint with the largest skinning weight of each control vertex."""
    return np.take_along_axis(person.skin_index, person.skin_weight.argmax(1)[:, None], 1)[:, 0]


def own_joints(side: str) -> list[int]:
    """Elbow, wrist and fingers of a side."""
    return [INDEX[f"{side}_elbow"], INDEX[f"{side}_wrist"], *range(J)[LEFT_HAND if side == "left" else RIGHT_HAND]]
