"""Holds out frames for judging, and gives them poses: the corrections of the trained frames around them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.yaw import yaw
from gsac.stages.contract import BadInput

FEWEST = 5
"""Fewest frames of a clip that can spare one."""
LONG = 60
"""Fewest frames left for training where frames are held out for choosing alone."""
NEAR = np.radians(45)
"""rad; frames between which the body turns by more share no pose correction: they are photos of a turn, not a clip."""


def hold_out(global_orient: np.ndarray, usable: np.ndarray, every: int) -> np.ndarray:
    """(m,) indices of the frames to hold out: every `every`-th of the usable ones in the order of yaw.

    A short clip holds out one, fewer than `FEWEST` frames none. global_orient: (T, 3) axis-angle; usable: (T,) bool.
    """
    frames = np.flatnonzero(usable)
    if every < 2 or len(frames) < FEWEST:
        return np.zeros(0, np.int64)
    every, yaws = min(every, len(frames)), yaw(rotation.exp(np.asarray(global_orient, np.float64)))[frames]
    return np.sort(frames[np.argsort(yaws, kind="stable")][every // 2::every])


def hold_out_named(frames: list[int], usable: np.ndarray) -> np.ndarray:
    """(m,) indices of those of the named frames that are usable. usable: (T,) bool. Raises BadInput."""
    if frames[-1] >= len(usable):
        raise BadInput(f"train.heldout_frames names frame {frames[-1]}, but the clip has frames 0 to {len(usable) - 1}")
    held = np.array([t for t in frames if usable[t]], np.int64)
    if not len(held):
        raise BadInput("train.heldout_frames: none of these frames has a mask and a fitted body; look at the warnings of smplx")
    if len(held) == usable.sum():
        raise BadInput("train.heldout_frames names every frame that could be trained on; leave some")
    return held


def hold_out_for_choosing(global_orient: np.ndarray, usable: np.ndarray, held: np.ndarray, every: int) -> np.ndarray:
    """(c,) indices of the frames to choose the number of gaussians by: others than held (m,) where the clip is long.

    A short clip needs its frames for training, and `held` serves both. global_orient: (T, 3) axis-angle; usable: (T,) bool.
    """
    rest = usable.copy()
    rest[held] = False
    others = hold_out(global_orient, rest, every)
    return others if len(others) and int(rest.sum()) - len(others) >= LONG else held


def carry_corrections(pose: np.ndarray, transl: np.ndarray, refined_pose: np.ndarray, refined_transl: np.ndarray,
                      trained: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gives every frame that was not trained on the pose correction of its trained neighbours in the clip.

    As fitted: pose (T, J, 3) axis-angle, transl (T, 3) m; after training: refined_pose (T, J, 3), refined_transl (T, 3);
    trained: (T,) bool. A correction is the turn from the fitted to the refined joint and the shift between the translations;
    both are interpolated linearly between the nearest trained frames, where one that is not near counts as not corrected.
    Returns pose (T, J, 3) and transl (T, 3), refined where trained.
    """
    frames = np.flatnonzero(trained)
    if not len(frames):
        return pose.copy(), transl.copy()
    out_pose, out_transl = refined_pose.copy(), refined_transl.copy()
    fitted = Rotation.from_rotvec(pose.reshape(-1, 3))
    turns = (fitted.inv() * Rotation.from_rotvec(refined_pose.reshape(-1, 3))).as_rotvec().reshape(pose.shape)
    shifts = refined_transl - transl
    for t in np.flatnonzero(~trained):
        after = np.searchsorted(frames, t)
        a, b = frames[max(after - 1, 0)], frames[min(after, len(frames) - 1)]
        u = (t - a) / (b - a) if b > a else 0.0
        before, behind = (1 - u) * is_near(pose[t, 0], pose[a, 0]), u * is_near(pose[t, 0], pose[b, 0])
        turn = before * turns[a] + behind * turns[b]
        out_pose[t] = (Rotation.from_rotvec(pose[t]) * Rotation.from_rotvec(turn)).as_rotvec()
        out_transl[t] = transl[t] + before * shifts[a] + behind * shifts[b]
    return out_pose, out_transl


def is_near(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(...) bool, whether the body turned by less than NEAR. one, other: (..., 3) axis-angle, global_orient."""
    turns, others = (Rotation.from_rotvec(np.reshape(each, (-1, 3))) for each in map(np.array, np.broadcast_arrays(one, other)))
    return ((turns.inv() * others).magnitude() < NEAR).reshape(np.broadcast_shapes(one.shape, other.shape)[:-1])
