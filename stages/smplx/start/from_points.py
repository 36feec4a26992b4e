"""Rotations of the body's joints from points in space, in closed form: trunk, head, hands, feet aligned, limbs laid along them."""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.joints import BODY, J
from gsac.avatar.joints import INDEX as JOINT
from gsac.avatar.wholebody import INDEX
from gsac.stages.smplx.initial import hang_arms
from gsac.stages.smplx.sightings import TRUNK

LIMBS = {"left_hip": ("left_knee", "left_ankle", (1, 0, 0)), "right_hip": ("right_knee", "right_ankle", (1, 0, 0)),
         "left_shoulder": ("left_elbow", "left_wrist", (0, -1, 0)), "right_shoulder": ("right_elbow", "right_wrist", (0, 1, 0))}
"""Upper joint of a limb -> its hinge, its end, and the axis at rest about which the hinge bends."""
LIMB_JOINTS = tuple(name for upper, (hinge, end, _) in LIMBS.items() for name in (upper, hinge, end))
"""Points that the rig has in the joint itself, as SMPL-X does."""
HEAD_POINTS = ("nose", "left_eye", "right_eye", "left_ear", "right_ear")
BENT = np.sin(np.radians(15))
"""Sine of the bend from which the hinge's axis says how the upper limb is twisted; below it the limb is swung only."""
ENDS = {"wrist": ("hand_index1", "hand_middle1", "hand_ring1", "hand_pinky1"), "ankle": ("big_toe", "small_toe", "heel")}
"""Joint at a limb's end -> points that it turns."""


def turn_to_points(body: Body, points: np.ndarray) -> np.ndarray:
    """Rotations (55, 3, 3) of the resting body's joints that lay it along points (133, 3) m, in the camera's axes; NaN of fingers,
    jaw and eyes. The spine stays straight."""
    rest = body.keypoints(body.v_template)
    joints = body.J_regressor @ body.v_template
    for name in LIMB_JOINTS:
        rest[INDEX[name]] = joints[JOINT[name]]
    local = hang_arms(1, J, body.joint_names)[0]
    whole = np.empty((J, 3, 3))

    def settle(joint: int, turned: np.ndarray | None = None) -> None:
        """Sets a joint's rotation in the camera's axes, or leaves it as it hangs on its parent."""
        above = whole[body.parents[joint]] if joint else np.eye(3)
        if turned is not None:
            local[joint] = above.T @ turned
        whole[joint] = above @ local[joint]

    def gather(names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        at = [INDEX[name] for name in names]
        return rest[at], points[at]

    ends = {f"{side}_{joint}": tuple(f"{side}_{name}" for name in (joint, *names))
            for joint, names in ENDS.items() for side in ("left", "right")}
    hinges: dict[int, np.ndarray] = {}
    for joint in range(BODY.stop):
        name = body.joint_names[joint]
        if joint == 0:
            settle(0, rotation.align(_hang_shoulders(rest[TRUNK], joints, local), points[TRUNK]))
        elif name == "head":
            settle(joint, rotation.align(*gather(HEAD_POINTS)))
        elif name in ends:
            settle(joint, rotation.align(*gather(ends[name])))
        elif name in LIMBS:
            hinge, end, axis = LIMBS[name]
            resting, posed = (np.diff(each, axis=0) for each in gather((name, hinge, end)))
            turned, hinges[JOINT[hinge]] = lay_limb(resting, posed, np.array(axis, float), whole[body.parents[joint]])
            settle(joint, turned)
        elif joint in hinges:
            settle(joint, hinges[joint])
        else:
            settle(joint)
    local[BODY.stop:] = np.nan
    return local


def _hang_shoulders(trunk: np.ndarray, joints: np.ndarray, local: np.ndarray) -> np.ndarray:
    """The resting points of TRUNK, shoulders where hanging collar bones hold them."""
    trunk = trunk.copy()
    for i, side in enumerate(("left", "right")):
        collar = JOINT[f"{side}_collar"]
        trunk[i] = joints[collar] + local[collar] @ (trunk[i] - joints[collar])
    return trunk


def lay_limb(resting: np.ndarray, posed: np.ndarray, axis: np.ndarray, above: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (3, 3) of a limb's upper and lower part in the camera's axes.

    resting, posed: (2, 3) m, along the upper and the lower part; axis: (3,) at rest, about which the hinge bends; above: (3, 3) of
    the parent. A bent limb is twisted so that its hinge alone bends it; a straight one is swung the shortest way.
    """
    resting, posed = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (resting, posed))
    bend = rotation.exp(axis * find_bend(resting, float(posed[0] @ posed[1]), axis))
    bent = np.stack([resting[0], bend @ resting[1]])
    if min(np.linalg.norm(np.cross(*pair)) for pair in (bent, posed)) > BENT:
        turned = frame_of(*posed) @ frame_of(*bent).T
        return turned, turned @ bend
    swung = swing(above @ resting[0], posed[0]) @ above
    return swung, swing(swung @ resting[1], posed[1]) @ swung


def find_bend(resting: np.ndarray, cosine: float, axis: np.ndarray) -> float:
    """The hinge's angle, rad, at which the parts have that cosine between them; the nearest where none has.

    resting: (2, 3), their directions, of length one; axis: (3,) of the hinge.
    """
    along = (resting[0] @ axis) * (axis @ resting[1])
    level, across = resting[0] @ resting[1] - along, resting[0] @ np.cross(axis, resting[1])
    return float(np.arctan2(across, level) + np.arccos(np.clip((cosine - along) / max(np.hypot(level, across), 1e-9), -1, 1)))


def frame_of(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Right-handed axes (3, 3) in columns: the first direction, and what stands across it and the second. first: (3,) of length
    one; second: (3,)."""
    across = np.cross(first, second)
    across /= np.linalg.norm(across)
    return np.stack([first, across, np.cross(first, across)], 1)


def swing(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The least rotation (3, 3) that takes a direction to another. source, target: (3,)."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    axis, cosine = np.cross(a, b), a @ b
    sine = np.linalg.norm(axis)
    if sine < 1e-9:
        return np.eye(3) if cosine > 0 else rotation.exp(np.pi * np.cross(a, np.eye(3)[np.abs(a).argmin()]))
    return rotation.exp(axis / sine * np.arctan2(sine, cosine))
