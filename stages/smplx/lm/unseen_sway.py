"""Sway of the hips over the feet that one camera does not see: along the view.

Who steps on the spot sways while they turn, as far towards the camera as across the picture. Across it the fit follows; along it
points tell little and the fit stays calm, so that what is missing there against across is how far the legs are off.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import INDEX
from gsac.avatar.yaw import turn_seen
from gsac.stages.findings import Code, Finding

LEAST = 0.04
"""m, missing sway (standard deviation) from which the legs are doubtful: feet are then off by 10 cm in one frame of eighty, and at
0.065 in one of eight."""
STANDING = np.radians(45)
"""Lean of the legs against the usual one from which on nobody sways: a photo lies on its side, or somebody lies down."""
LEAST_TURN = 270.0
"""Degrees that the frames show at least: of who hardly turns nothing says that they sway alike in both directions."""


def find_unseen_sway(turns: np.ndarray, joints: np.ndarray) -> list[Finding]:
    """The finding where legs are doubtful along the view.

    turns: (T, 3, 3) of the pelvis to the camera frame; joints: (T, 55, 3) m, camera frame.
    """
    missing = measure_missing_sway(joints)
    if missing < LEAST or turn_seen(turns) < LEAST_TURN:
        return []
    return [Finding.of(Code.LEGS_DOUBTFUL, np.ones(len(joints), bool), figure=200 * missing)]


def measure_missing_sway(joints: np.ndarray) -> float:
    """m, standard deviation of the sway that the fit lacks along the view against across it, in frames in which the hips are over
    the feet as in most. joints: (T, 55, 3) m, camera frame."""
    feet = joints[:, [INDEX["left_ankle"], INDEX["right_ankle"]]].mean(1)
    legs = joints[:, INDEX["pelvis"]] - feet
    usual = np.median(legs, 0)
    stands = legs @ usual >= np.cos(STANDING) * np.linalg.norm(legs, axis=1) * np.linalg.norm(usual)
    across, _, along = legs[stands].var(0) if stands.any() else np.zeros(3)
    return float(np.sqrt(max(across - along, 0.0)))
