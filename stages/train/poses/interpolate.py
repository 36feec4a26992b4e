"""Interpolates poses of untrained frames between trained ones, and adds part of the frame's own deviation in the body fit.

The fit is noisier from frame to frame than the refined poses, so a frame's own fit, however corrected, shakes; its neighbours
alone miss sudden motion. The share of a frame's own deviation from its neighbours to keep is estimated on trained frames.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar import rotation
from gsac.stages.train.choose_heldout import is_near

SIDES = (2, 2), (2, 1), (1, 2)
"""Trained frames before and after a frame that it is interpolated between: one is enough where the clip has no more."""
LONGEST = 4
"""Most frames from one trained neighbour to the other: a cubic overshoots in longer gaps."""
FEWEST = 10
"""Fewest trained frames to estimate the share from."""


def follow_neighbours(fit_pose: np.ndarray, fit_transl: np.ndarray, pose: np.ndarray, transl: np.ndarray,
                      trained: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moves untrained frames to the polynomial through their trained neighbours plus the trusted share of their own deviation.

    pose (T, J, 3) axis-angle and transl (T, 3) m are refined where trained (T,) bool; fit_pose (T, J, 3) and fit_transl (T, 3) are
    the body fit's. Frames without such neighbours, near in time and yaw, stay. Returns pose (T, J, 3), transl (T, 3).
    """
    frames, others, out_pose, out_transl = np.flatnonzero(trained), np.flatnonzero(~trained), pose.copy(), transl.copy()
    fit, own, most = Motion(fit_pose, fit_transl), Motion(pose, transl), max(SIDES[0])
    for before, after in SIDES:
        asked = others[(np.minimum(np.searchsorted(frames, others), most) == before)
                       & (np.minimum(len(frames) - np.searchsorted(frames, others), most) == after)]
        moved, between = find_neighbours(asked, frames, fit_pose[:, 0], before, after)
        known, among = find_neighbours(frames, frames, fit_pose[:, 0], before, after)
        if len(moved) and len(known) >= FEWEST:
            share = trusted_share(fit.deviation(known, among), own.deviation(known, among))
            (turns, places), deviation = own.between(moved, between), share * fit.deviation(moved, between)
            out_pose[moved] = rotation.log(rotation.exp(deviation[:, :-1]) @ turns)
            out_transl[moved] = places + deviation[:, -1]
    return out_pose, out_transl


def find_neighbours(asked: np.ndarray, frames: np.ndarray, global_orient: np.ndarray, before: int,
                    after: int) -> tuple[np.ndarray, np.ndarray]:
    """Those of the frames asked (m,) that have as many neighbours among frames (n,), itself left out, near in time and yaw.

    global_orient: (T, 3) axis-angle. Returns (k,) frames, (k, before + after) their neighbours.
    """
    first, end = np.searchsorted(frames, asked), np.searchsorted(frames, asked, side="right")
    enough = (first >= before) & (end + after <= len(frames))
    asked, first, end = asked[enough], first[enough], end[enough]
    around = frames[np.concatenate([first[:, None] + np.arange(-before, 0), end[:, None] + np.arange(after)], 1)]
    near = around[:, before] - around[:, before - 1] <= LONGEST
    near &= is_near(global_orient[around], global_orient[asked, None]).all(1)
    return asked[near], around[near]


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

    def between(self, frames: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (n, J, 3, 3) and translations (n, 3) m at frames (n,) by the polynomials through those around them (n, k).

        Rotations are taken relative to one of these.
        """
        k = around.shape[1]
        ahead, apart = (frames[:, None] - around)[:, None], around[:, :, None] - around[:, None]
        weight = np.where(np.eye(k, dtype=bool), 1.0, ahead / np.where(apart, apart, 1)).prod(2)
        middle = self.turns[around[:, k // 2]]
        steps = rotation.log(middle.swapaxes(2, 3)[:, None] @ self.turns[around])
        return (middle @ rotation.exp(np.einsum("nk,nkja->nja", weight, steps)),
                np.einsum("nk,nka->na", weight, self.places[around]))

    def deviation(self, frames: np.ndarray, around: np.ndarray) -> np.ndarray:
        """(n, J + 1, 3) turns in the axes of each joint's parent, rad, and shift, m, from the polynomials to the frames.

        frames: (n,); around: (n, k) frames that the polynomials go through.
        """
        turns, places = self.between(frames, around)
        return np.concatenate([rotation.log(self.turns[frames] @ turns.swapaxes(2, 3)),
                               (self.places[frames] - places)[:, None]], 1)
