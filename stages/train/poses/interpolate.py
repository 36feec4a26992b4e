"""Interpolates poses of untrained frames between trained ones, and adds part of the frame's own deviation in the body fit.

The fit is noisier from frame to frame than the refined poses, so a frame's own fit, however corrected, shakes; its neighbours
alone miss sudden motion. The share of a frame's own deviation from its neighbours to keep is estimated on trained frames.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.stages.train.choose_heldout import is_near

SIDE = 2
"""Trained frames on each side that a frame is interpolated between."""
LONGEST = 4
"""Most frames from one trained neighbour to the other: a cubic overshoots in longer gaps."""
FEWEST = 10
"""Fewest trained frames to estimate the share from."""


def follow_neighbours(fit_pose: np.ndarray, fit_transl: np.ndarray, pose: np.ndarray, transl: np.ndarray,
                      trained: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moves untrained frames to the cubic of their trained neighbours plus the trusted share of their own deviation.

    pose (T, J, 3) axis-angle and transl (T, 3) m are refined where trained (T,) bool; fit_pose (T, J, 3) and fit_transl (T, 3) are
    the body fit's. Frames without two neighbours on each side, near in time and yaw, stay. Returns pose (T, J, 3), transl (T, 3).
    """
    frames, out_pose, out_transl = np.flatnonzero(trained), pose.copy(), transl.copy()
    around = {t: found for t in range(len(pose)) if (found := find_neighbours(t, frames, fit_pose[:, 0])) is not None}
    fit, own = Motion(fit_pose, fit_transl), Motion(pose, transl)
    known = [t for t in around if trained[t]]
    if len(known) < FEWEST:
        return out_pose, out_transl
    share = trusted_share(*(np.stack([motion.deviation(t, around[t]) for t in known]) for motion in (fit, own)))
    for t in around:
        if not trained[t]:
            turns, place = own.cubic(t, around[t])
            deviation = share * fit.deviation(t, around[t])
            out_pose[t], out_transl[t] = rotation.log(rotation.exp(deviation[:-1]) @ turns), place + deviation[-1]
    return out_pose, out_transl


def find_neighbours(t: int, frames: np.ndarray, global_orient: np.ndarray) -> np.ndarray | None:
    """(2 SIDE,) of frames (n,), without t, that t can be interpolated between, or None. global_orient: (T, 3) axis-angle."""
    before, after = frames[frames < t][-SIDE:], frames[frames > t][:SIDE]
    found = np.append(before, after)
    if len(found) < 2 * SIDE or after[0] - before[-1] > LONGEST or not is_near(global_orient[found], global_orient[t]).all():
        return None
    return found


def trusted_share(fit: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(J + 1, 1) in 0..1: the share of the fit's deviations from its neighbours that the refined poses confirm, by joint.

    fit, own: (n, J + 1, 3) deviations of trained frames, in the fit and in the refined poses.
    """
    both, alone = (fit * own).sum((0, 2)), (fit * fit).sum((0, 2))
    return np.clip(np.divide(both, alone, out=np.ones_like(both), where=alone > 0), 0, 1)[:, None]


class Motion:
    """Poses of a clip, as rotations. pose: (T, J, 3) axis-angle; transl: (T, 3) m."""

    def __init__(self, pose: np.ndarray, transl: np.ndarray):
        self.turns, self.places = rotation.exp(np.asarray(pose, np.float64)), np.asarray(transl, np.float64)

    def cubic(self, t: int, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (J, 3, 3) and translation (3,) m at t by the cubic through frames around (2 SIDE,), relative to one of them."""
        weight = np.array([np.prod([(t - other) / (frame - other) for other in around if other != frame]) for frame in around])
        middle = self.turns[around[SIDE]]
        steps = rotation.log(middle.swapaxes(1, 2) @ self.turns[around])
        return middle @ rotation.exp(np.tensordot(weight, steps, 1)), weight @ self.places[around]

    def deviation(self, t: int, around: np.ndarray) -> np.ndarray:
        """(J + 1, 3) turns in the axes of each joint's parent, rad, and shift, m, from the cubic of around (2 SIDE,) to frame t."""
        turns, place = self.cubic(t, around)
        return np.vstack([rotation.log(self.turns[t] @ turns.swapaxes(1, 2)), self.places[t] - place])
