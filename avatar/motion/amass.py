"""Reads AMASS-style npz files: SMPL, SMPL-H or SMPL-X rotations as axis-angle. Every error names the file and the array."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import ArtifactError, read_arrays
from gsac.avatar.joints import BODY, FINGERS, POSE_PARTS, J
from gsac.avatar.motion import quat
from gsac.avatar.motion.source import LARGEST, MotionError, Source, most_frames, too_long

FPS = 30.0
"""Frames a second, where the file gives no rate."""
RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
TRANSL = ("trans", "transl")
LAYOUTS = {72: [(0, 22, BODY)], 156: [(0, 22, BODY), (22, 52, FINGERS)], 165: [(0, J, slice(0, J))]}
"""Width of `poses` -> (first, end, ours) in joints: SMPL (its two hand joints are left out), SMPL-H, SMPL-X."""
PARTS = {
    "root_orient": POSE_PARTS["global_orient"], "pose_body": POSE_PARTS["body_pose"], "pose_jaw": POSE_PARTS["jaw_pose"],
    "pose_eye": slice(23, 25), "pose_hand": FINGERS,
} | POSE_PARTS
"""AMASS' names for parts of a pose, and SMPL-X's -> their joints; where a file has both, SMPL-X's count."""


def read_amass(path: Path, joint_names: list[str], parents: np.ndarray, joints: np.ndarray) -> Source:
    """The motion on the avatar's own skeleton: joint_names (55), parents (55,), joints (55, 3) m. Raises MotionError."""
    try:
        arrays = read_arrays(path)
    except (ArtifactError, MemoryError) as e:
        raise MotionError(str(e) or f"{path}: an array says that it is larger than the memory") from e
    pose = _pose(arrays, str(path))
    T = len(pose)
    if len(joint_names) != J:
        raise MotionError(f"{path}: its {J} joints are SMPL-X's, and the avatar has {len(joint_names)} others")
    name = next((n for n in TRANSL if n in arrays), None)
    transl = np.zeros((T, 3)) if name is None else _numbers(arrays, name, (T, 3), str(path))
    rate = next((n for n in RATES if n in arrays), None)
    fps = FPS if rate is None else float(_numbers(arrays, rate, (), str(path)))
    if not 0.1 <= fps <= 10000:
        raise MotionError(f"{path}: array {rate} says {fps:g} frames a second; 0.1 to 10000 is expected")

    local = quat.from_rotvec(pose)
    joints = np.asarray(joints, float)
    turns, places = np.empty((T, J, 4)), np.empty((T, J, 3))
    for j, parent in enumerate(parents):
        if parent < 0:
            turns[:, j], places[:, j] = local[:, j], joints[j] + transl
        else:
            turns[:, j] = quat.multiply(turns[:, parent], local[:, j])
            places[:, j] = places[:, parent] + quat.rotate(turns[:, parent], joints[j] - joints[parent])
    return Source(fps, list(joint_names), np.asarray(parents), np.tile(quat.IDENTITY, (J, 1)), joints, turns, places)


def _pose(arrays: dict[str, np.ndarray], where: str) -> np.ndarray:
    """(T, 55, 3) axis-angle."""
    if "poses" in arrays:
        shape = arrays["poses"].shape
        if len(shape) != 2 or shape[1] not in LAYOUTS or not shape[0]:
            raise MotionError(f"{where}: array poses has shape {shape}; expected (T, 72), (T, 156) or (T, 165)")
        _check_length(shape[0], where)
        given = _numbers(arrays, "poses", shape, where).reshape(shape[0], -1, 3)
        out = np.zeros((shape[0], J, 3))
        for first, end, ours in LAYOUTS[shape[1]]:
            out[:, ours] = given[:, first:end]
        return out
    parts = {name: at for name, at in PARTS.items() if name in arrays}
    if not any(at == POSE_PARTS["body_pose"] for at in parts.values()):
        raise MotionError(f"{where}: no array poses, pose_body or body_pose (it has {', '.join(sorted(arrays)[:20])})")
    body = next(name for name, at in parts.items() if at == POSE_PARTS["body_pose"])
    if arrays[body].ndim < 2 or not len(arrays[body]):
        raise MotionError(f"{where}: array {body} has shape {arrays[body].shape}; expected (T, 63)")
    T = len(arrays[body])
    _check_length(T, where)
    out = np.zeros((T, J, 3))
    for name, at in parts.items():
        out[:, at] = _numbers(arrays, name, (T, 3 * (at.stop - at.start)), where).reshape(T, -1, 3)
    return out


def _check_length(frames: int, where: str) -> None:
    if frames > most_frames(J):
        raise MotionError(f"{where}: {too_long(frames, J)}")


def _numbers(arrays: dict[str, np.ndarray], name: str, shape: tuple[int, ...], where: str) -> np.ndarray:
    """The array as float64 of that shape; (T, J, 3) is taken for (T, 3 J)."""
    array = arrays[name]
    if array.dtype.kind not in "fiu":
        raise MotionError(f"{where}: array {name} holds {array.dtype}, expected numbers")
    if array.ndim == 3 and len(shape) == 2:
        array = array.reshape(len(array), -1)
    if array.size == 1 and shape == ():
        array = array.reshape(())
    if array.shape != shape:
        raise MotionError(f"{where}: array {name} has shape {arrays[name].shape}, expected {shape}")
    if not (np.abs(array.astype(float)) <= LARGEST).all():
        raise MotionError(f"{where}: array {name} is not finite, or has numbers beyond {LARGEST:g}")
    return array.astype(float)
