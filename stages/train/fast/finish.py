"""The end of every level: on bones turned back, cut and on faces that carry its gaussians where joints bend, without strays."""

from __future__ import annotations

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians import joint_cuts, joint_faces, joint_strays
from gsac.stages.train.gaussians.joint_cuts import Cut
from gsac.stages.train.poses.bone_drift import remove_drift
from gsac.stages.train.poses.poses import Poses


class Finish:
    """Finishes levels, one at a time; first removes the drift from the poses."""

    def __init__(self, poses: Poses, trained: np.ndarray):
        """trained: (n,) indices of frames."""
        self.drift = remove_drift(poses, trained)
        self.carried = joint_faces.bend_faces(poses, trained)
        self.seen = joint_strays.bend_silhouettes(poses, trained)

    def __call__(self, gaussians: Gaussians) -> Cut:
        """The gaussians, of the poses as they were, as they are handed out."""
        held = joint_faces.hold_at_joints(self.drift.undo(gaussians), self.carried)
        cut, source = joint_cuts.cut_at_joints(held, self.carried, self.seen)
        return Cut(joint_strays.draw_in_strays(cut, self.seen), source)
