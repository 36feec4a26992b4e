"""Poses of frames that were not trained on, between frames that were: the motion of those, and what the body fit knows beside it.

The fit errs from frame to frame where the refined poses do not, so a frame's own fit, however corrected, shakes. Its neighbours
alone miss what is sudden. How much of what the fit has beside its own neighbours is true is learned from the trained frames.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.stages.train.holdout import near

SIDE = 2
"""Trained frames on each side that a frame follows."""
LONGEST = 4
"""Frames from one trained neighbour to the other, at most: a cubic swings in longer gaps."""
FEWEST = 10
"""Trained frames that must tell how far the fit is to be believed."""


def follow_neighbours(fit_pose: np.ndarray, fit_transl: np.ndarray, pose: np.ndarray, transl: np.ndarray,
                      trained: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moves frames that were not trained on to where the cubic of their trained neighbours, and their own fit, have them.

    pose: (T, J, 3) axis-angle and transl (T, 3), refined where trained (T,) bool; fit_*: as the body fit gave them. Frames without
    two neighbours on each side, near in time and yaw, stay as they are. Returns pose, transl.
    """
    frames, out_pose, out_transl = np.flatnonzero(trained), pose.copy(), transl.copy()
    around = {t: found for t in range(len(pose)) if (found := neighbours(t, frames, fit_pose[:, 0])) is not None}
    fit, own = Motion(fit_pose, fit_transl), Motion(pose, transl)
    known = [t for t in around if trained[t]]
    if len(known) < FEWEST:
        return out_pose, out_transl
    belief = believed(*(np.stack([motion.beside(t, around[t]) for t in known]) for motion in (fit, own)))
    for t in around:
        if not trained[t]:
            turns, place = own.cubic(t, around[t])
            beside = belief * fit.beside(t, around[t])
            out_pose[t], out_transl[t] = rotation.log(rotation.exp(beside[:-1]) @ turns), place + beside[-1]
    return out_pose, out_transl


def neighbours(t: int, frames: np.ndarray, global_orient: np.ndarray) -> np.ndarray | None:
    """(2 SIDE,) those of `frames`, t aside, that frame t can follow. global_orient: (T, 3) axis-angle."""
    before, after = frames[frames < t][-SIDE:], frames[frames > t][:SIDE]
    found = np.append(before, after)
    if len(found) < 2 * SIDE or after[0] - before[-1] > LONGEST or not near(global_orient[found], global_orient[t]).all():
        return None
    return found


def believed(fit: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(J + 1, 1) in 0..1: the share of what the fit has beside its neighbours that the refined poses have beside theirs.

    fit, own: (n, J + 1, 3) of trained frames.
    """
    both, alone = (fit * own).sum((0, 2)), (fit * fit).sum((0, 2))
    return np.clip(np.divide(both, alone, out=np.ones_like(both), where=alone > 0), 0, 1)[:, None]


class Motion:
    """Poses of a clip, as rotations."""

    def __init__(self, pose: np.ndarray, transl: np.ndarray):
        self.turns, self.places = rotation.exp(np.asarray(pose, np.float64)), np.asarray(transl, np.float64)

    def cubic(self, t: int, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (J, 3, 3) and translation (3,) at t by the cubic through the frames `around`, about one of them."""
        weight = np.array([np.prod([(t - other) / (frame - other) for other in around if other != frame]) for frame in around])
        middle = self.turns[around[SIDE]]
        steps = rotation.log(middle.swapaxes(1, 2) @ self.turns[around])
        return middle @ rotation.exp(np.tensordot(weight, steps, 1)), weight @ self.places[around]

    def beside(self, t: int, around: np.ndarray) -> np.ndarray:
        """(J + 1, 3) turns in the axes of each joint's parent, and shift, from that cubic to frame t itself."""
        turns, place = self.cubic(t, around)
        return np.vstack([rotation.log(self.turns[t] @ turns.swapaxes(1, 2)), self.places[t] - place])
