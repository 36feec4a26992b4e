"""Which frames are kept for judging, and what pose they are judged with."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.yaw import yaw

FEWEST = 5
"""Frames below which every one is needed for training."""
LONG = 60
"""Frames that must be left for training where some are kept to choose by that nothing else is judged on."""
NEAR = np.radians(45)
"""Frames between which the body turns by more say nothing of each other's pose: photos of one turn, not a clip."""


def spaced_in_yaw(global_orient: np.ndarray, usable: np.ndarray, every: int) -> np.ndarray:
    """Indices of the frames to hold out: every `every`-th of the usable (T,) bool frames in the order of yaw.

    A short clip keeps one; fewer than `FEWEST` frames keep none.
    """
    frames = np.flatnonzero(usable)
    if every < 2 or len(frames) < FEWEST:
        return np.zeros(0, np.int64)
    every, yaws = min(every, len(frames)), yaw(rotation.exp(np.asarray(global_orient, np.float64)))[frames]
    return np.sort(frames[np.argsort(yaws, kind="stable")][every // 2::every])


def to_choose_by(global_orient: np.ndarray, usable: np.ndarray, held: np.ndarray, every: int) -> np.ndarray:
    """Indices of the frames that the number of gaussians is chosen by.

    Others than `held` where the clip is long; a short one needs its frames for training, and those of `held` serve for both.
    """
    rest = usable.copy()
    rest[held] = False
    others = spaced_in_yaw(global_orient, rest, every)
    return others if len(others) and int(rest.sum()) - len(others) >= LONG else held


def carry_corrections(pose: np.ndarray, transl: np.ndarray, refined_pose: np.ndarray, refined_transl: np.ndarray,
                      trained: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gives every frame that was not trained on the pose correction of its trained neighbours in the clip.

    pose: (T, J, 3) axis-angle and transl (T, 3) as fitted; refined_*: the same after training; trained: (T,) bool.
    A correction is the turn from the fitted to the refined joint and the shift between the translations; both are
    interpolated linearly between the nearest trained frames, of which one that is not near counts as not corrected.
    Returns pose, transl: refined where trained.
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
        before, behind = (1 - u) * near(pose[t, 0], pose[a, 0]), u * near(pose[t, 0], pose[b, 0])
        turn = before * turns[a] + behind * turns[b]
        out_pose[t] = (Rotation.from_rotvec(pose[t]) * Rotation.from_rotvec(turn)).as_rotvec()
        out_transl[t] = transl[t] + before * shifts[a] + behind * shifts[b]
    return out_pose, out_transl


def near(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(...) bool of global_orient (..., 3) axis-angle: the body turned by less than NEAR."""
    turn = Rotation.from_rotvec(np.reshape(one, (-1, 3))).inv() * Rotation.from_rotvec(np.reshape(other, (-1, 3)))
    return (turn.magnitude() < NEAR).reshape(np.shape(one)[:-1])
