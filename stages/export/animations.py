"""Poses and animations that an avatar carries: T-pose, A-pose, a wave, a walk on the spot.

Keys are axis-angle, rad, in SMPL-X's canonical axes: +x bends the spine forward and the knees, and swings a leg back; the left arm
lies along +x, so -z lowers it and +z lowers the right one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.config import AnimationName

FPS = 20.0
WAVE_S = 3.2
WALK_S = 1.15
Angle = float | np.ndarray
FINGERS = ("index", "middle", "ring", "pinky")


def still_poses() -> dict[str, dict[str, list[float]]]:
    """Pose -> joint -> axis-angle, rad. `T`: zero rotation; `A`: arms 50 degrees down, fingers slightly bent."""
    a = {"left_shoulder": [0.0, 0.0, -0.87], "right_shoulder": [0.0, 0.0, 0.87]}
    for finger in FINGERS:
        for k in (1, 2, 3):
            a[f"left_{finger}{k}"] = [0.0, 0.0, -0.12]
            a[f"right_{finger}{k}"] = [0.0, 0.0, 0.12]
    return {"T": {}, "A": a}


def add_motion(avatar: RiggedAvatar, names: tuple[str, ...]) -> None:
    """Gives the avatar the still poses and the named animations, restricted to the joints that it has."""
    avatar.poses = {name: {j: r for j, r in pose.items() if j in avatar.joint_names}
                    for name, pose in still_poses().items()}
    avatar.clips = {name: CLIPS[name](avatar) for name in names}


def wave(avatar: RiggedAvatar) -> Animation:
    """The right hand waves; the body breathes and leans slightly."""
    t = np.arange(round(WAVE_S * FPS)) / (WAVE_S * FPS)
    turn = 2 * np.pi * t
    swing = np.sin(4 * turn)
    breath = np.sin(turn)
    raised = -1.1 + 0.05 * breath  # the upper arm's twist, split between both ends: all of it in one joint would tear the skin
    tracks = _hang_arms(t)
    tracks |= {
        "spine1": _about(t, x=0.02 + 0.01 * breath, z=0.02 * np.sin(turn + 0.5)),
        "spine2": _about(t, x=0.015 * breath, y=0.03 * np.sin(turn)),
        "neck": _about(t, x=0.03, z=-0.04 + 0.02 * np.sin(turn + 1)),
        "head": _about(t, y=-0.06 + 0.05 * np.sin(turn + 0.3), z=-0.05 + 0.03 * np.sin(2 * turn)),
        "right_collar": _about(t, z=-0.12),
        "right_shoulder": (_turn(t, z=0.1 + 0.04 * np.sin(2 * turn)) * _turn(t, y=0.15) * _turn(t, x=0.5 * raised)).as_rotvec(),
        "right_elbow": (_turn(t, x=0.5 * raised) * _turn(t, y=1.2 + 0.2 * swing)).as_rotvec(),
        "right_wrist": _about(t, y=0.16 * np.sin(4 * turn - 0.9)),
    }
    for finger, spread in zip(FINGERS, (0.10, 0.03, -0.03, -0.10), strict=True):
        tracks[f"right_{finger}1"] = _about(t, y=spread, z=0.06)
        for k in (2, 3):
            tracks[f"right_{finger}{k}"] = _about(t, z=0.08)
    return _ground(avatar, tracks)


def walk(avatar: RiggedAvatar) -> Animation:
    """One double step on the spot; the pelvis rises and sinks so that the lower foot stays on the floor."""
    t = np.arange(round(WALK_S * FPS)) / round(WALK_S * FPS)
    tracks = _hang_arms(t)
    turn = 2 * np.pi * t
    for side, phase, out in (("left", 0.0, 1.0), ("right", 0.5, -1.0)):
        p = (t + phase) % 1
        hip = _periodic(p, HIP)
        tracks[f"{side}_hip"] = (_turn(t, y=0.05 * out) * _turn(t, z=-0.07 * out) * _turn(t, x=-hip)).as_rotvec()
        tracks[f"{side}_knee"] = _about(t, x=_periodic(p, KNEE))
        tracks[f"{side}_ankle"] = _about(t, x=-_periodic(p, ANKLE), z=0.05 * out)
        tracks[f"{side}_foot"] = _about(t, x=-_periodic(p, TOES))
        swing = 0.38 * np.cos(2 * np.pi * p)
        tracks[f"{side}_shoulder"] = (_turn(t, x=swing) * _turn(t, z=-1.32 * out)).as_rotvec()
        tracks[f"{side}_elbow"] = _about(t, y=-out * (0.30 - 0.35 * np.minimum(swing, 0)))
    tracks |= {
        "pelvis": _about(t, y=-0.07 * np.cos(turn), z=0.03 * np.sin(turn)),
        "spine1": _about(t, x=0.02 + 0.01 * np.cos(2 * turn), z=-0.03 * np.sin(turn)),
        "spine2": _about(t, y=0.07 * np.cos(turn)),
        "spine3": _about(t, y=0.08 * np.cos(turn)),
        "neck": _about(t, y=-0.04 * np.cos(turn)),
        "head": _about(t, x=-0.03, y=-0.04 * np.cos(turn)),
    }
    return _ground(avatar, tracks)


CLIPS: dict[AnimationName, Callable[[RiggedAvatar], Animation]] = {"wave": wave, "walk": walk}

HIP = ((0.0, 0.40), (0.12, 0.32), (0.3, 0.02), (0.5, -0.26), (0.58, -0.16), (0.72, 0.28), (0.86, 0.47))
"""(time in the cycle, angle in rad); at 0 this heel strikes; a leg forward is positive."""
KNEE = ((0.0, 0.05), (0.13, 0.22), (0.35, 0.04), (0.5, 0.28), (0.62, 0.84), (0.73, 0.98), (0.88, 0.34))
"""Bent is positive."""
ANKLE = ((0.0, 0.0), (0.08, -0.10), (0.25, 0.08), (0.44, 0.19), (0.58, -0.30), (0.70, -0.04), (0.85, 0.04))
"""Toes up is positive."""
TOES = ((0.0, 0.05), (0.15, 0.0), (0.4, 0.0), (0.54, 0.42), (0.63, 0.05), (0.8, 0.0))
"""Toes up is positive."""


def _hang_arms(t: np.ndarray) -> dict[str, np.ndarray]:
    """Both arms hang, elbows and fingers slightly bent; (K, 3) axis-angle by joint."""
    tracks = {}
    breath = 0.012 * np.sin(2 * np.pi * t)
    for side, out in (("left", 1.0), ("right", -1.0)):
        tracks[f"{side}_shoulder"] = _about(t, z=-out * (1.3 + breath))
        tracks[f"{side}_elbow"] = _about(t, y=-out * 0.3)
        tracks[f"{side}_wrist"] = _about(t, z=-out * 0.05)
        for finger, bend in zip(FINGERS, (0.22, 0.28, 0.34, 0.40), strict=True):
            for k in (1, 2, 3):
                tracks[f"{side}_{finger}{k}"] = _about(t, z=-out * bend)
    return tracks


def _turn(t: np.ndarray, x: Angle = 0, y: Angle = 0, z: Angle = 0) -> Rotation:
    return Rotation.from_rotvec(_about(t, x, y, z))


def _about(t: np.ndarray, x: Angle = 0, y: Angle = 0, z: Angle = 0) -> np.ndarray:
    """(K, 3) axis-angle from its components."""
    return np.stack(np.broadcast_arrays(x, y, z, t)[:3], axis=-1)


def _periodic(t: np.ndarray, keys: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Smooth periodic curve through keys (time in 0..1, value)."""
    from scipy.interpolate import CubicSpline

    times, values = np.array([*keys, (keys[0][0] + 1, keys[0][1])]).T
    return CubicSpline(times, values, bc_type="periodic")(t % 1)


def _ground(avatar: RiggedAvatar, tracks: dict[str, np.ndarray]) -> Animation:
    """A looping clip; its transl puts the lowest vertex of each key on the floor. tracks: (K, 3) axis-angle by joint."""
    joints = [name for name in avatar.joint_names if name in tracks]
    rotation = np.stack([tracks[name] for name in joints], axis=1).astype(np.float32)
    clip = Animation(FPS, True, joints, rotation, np.zeros((len(rotation), 3), np.float32))
    index = [avatar.joint_names.index(name) for name in joints]
    for k, keys in enumerate(rotation):
        pose = np.zeros((len(avatar.joints), 3), np.float32)
        pose[index] = keys
        clip.transl[k, 1] = avatar.ground - avatar.posed(pose)[:, 1].min()
    return clip
