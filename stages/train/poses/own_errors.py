"""Each frame's own error late in a training: Gauss-Newton steps of every pose to its own image, the avatar held still.

`bundle_adjust` takes what all frames share and what is smooth in time out of the poses, and holds each frame's own part, which an
avatar that is still soft tells badly. As it sharpens it tells that part, too, but in a clip of 60 frames Adam moves a pose in one
step of 60. On the CPU each of its steps goes on from there, by its own gradient and the frame's last Hessian.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY
from gsac.stages.train.choose_heldout import carry_corrections
from gsac.stages.train.finite import require_finite
from gsac.stages.train.poses.bundle_adjust import Equations
from gsac.stages.train.poses.newton import NewtonSteps
from gsac.stages.train.poses.photometric import CORRELATED, TURNING, UNKNOWNS
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

TURN, SHIFT = 0.004, 0.0013
"""rad and m, sigma of what a step corrects: limbs that the image hardly tells of stay."""


def correct_each(poses: Poses, trained: np.ndarray, gaussians: Callable[[], Gaussians],
                 equations: Equations) -> dict[int, np.ndarray]:
    """Takes one step of each trained frame, carries it to the frames between them, and makes the poses as they stand the new base.

    trained: (n,) indices of frames; gaussians: returns them as they stand. Returns frame -> (U, U), which takes a gradient of half
    the squared error, summed over pixels and channels, to minus such a step.
    """
    held = np.diag(np.append(np.full(3 * TURNING, TURN**-2), np.full(3, SHIFT**-2)))
    moves, inverses = np.zeros((len(poses.pose), UNKNOWNS)), {}
    for t, normal in equations(gaussians()):
        known = 1 / (max(normal.error / max(4 * normal.pixels, 1), 1e-5) * CORRELATED)
        inverses[t] = known * np.linalg.inv(known * normal.hessian + held)
        moves[t] = -inverses[t] @ normal.gradient
        require_finite("late in the training", {f"correction of frame {t}'s pose": moves[t]})
    turns = rotation.exp(moves[:, :-3].reshape(-1, TURNING, 3))
    poses.pose[:, BODY] = rotation.log(rotation.exp(poses.pose[:, BODY]) @ turns)
    poses.transl += moves[:, -3:]
    is_trained = np.isin(np.arange(len(moves)), trained)
    poses.pose, poses.transl = carry_corrections(poses.base_pose, poses.base_transl, poses.pose, poses.transl, is_trained)
    poses.settle()
    return inverses


def newton_steps(inverses: dict[int, np.ndarray], views: dict[int, View]) -> dict[int, NewtonSteps]:
    """Those of a training. inverses: frame -> (U, U), as `correct_each` returns them; views: those of the equations.

    Half the squared error is 3/2 h w times L2, which is a mean over pixels and channels.
    """
    return {t: NewtonSteps((1.5 * views[t].camera.height * views[t].camera.width * inverse).astype(np.float32))
            for t, inverse in inverses.items()}
