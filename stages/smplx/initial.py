"""Initial state of the fit: the trunk aligned with the detector's 3-D points, then placed by its 2-D points."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.avatar.wholebody import INDEX
from gsac.stages.smplx.prior import BODY_JOINTS, MEAN
from gsac.stages.smplx.sightings import TRUNK, Sightings
from gsac.stages.smplx.state import State

TURNING = TRUNK + [INDEX[n] for n in ("nose", "left_ear", "right_ear")]
UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""Canonical to camera axes of a person who stands upright and faces the camera."""


def hang_arms(frames: int, joints: int, joint_names: tuple[str, ...]) -> np.ndarray:
    """Joint rotations (T, J, 3, 3) of hanging arms, all other joints at rest."""
    local = np.tile(np.eye(3), (frames, joints, 1, 1))
    for name, degrees in MEAN.items():
        local[:, joint_names.index(name)] = rotation.exp(np.radians(np.array(degrees, float)))
    return local


def align_trunk(rest: np.ndarray, world: np.ndarray, xy: np.ndarray, known: np.ndarray, focal: float,
               center: np.ndarray) -> np.ndarray | None:
    """Rotation (3, 3) of the body in one frame, or None where too little was seen.

    rest: (133, 3) m, key points of the resting body; world: (133, 3) m, detector points, NaN where absent; xy: (133, 2) px;
    known: (133,) bool; focal: px; center: (2,) px.
    """
    use = [i for i in TURNING if known[i] and np.isfinite(world[i]).all()]
    if sum(i in TRUNK for i in use) >= 3:
        weight = np.array([1.0 if i in TRUNK else 0.3 for i in use])
        return rotation.align(rest[use], world[use], weight)
    use = [i for i in range(23) if known[i] and np.isfinite(rest[i]).all()]
    if len(use) < 5:
        return None
    intrinsics = np.array([[focal, 0, center[0]], [0, focal, center[1]], [0, 0, 1.0]])
    ok, turn, _ = cv2.solvePnP(rest[use].astype(np.float64), xy[use].astype(np.float64), intrinsics, None, flags=cv2.SOLVEPNP_SQPNP)
    return cv2.Rodrigues(turn)[0] if ok else None


def solve_transl(points: np.ndarray, xy: np.ndarray, focal: float, center: np.ndarray) -> np.ndarray:
    """Translation (3,) m that projects points (P, 3) m onto xy (P, 2) px, by linear least squares. focal: px; center: (2,) px."""
    rows, want = [], []
    for p, u in zip(points, (xy - center) / focal, strict=True):
        for c in (0, 1):
            row = np.zeros(3)
            row[c], row[2] = 1, -u[c]
            rows.append(row)
            want.append(u[c] * p[2] - p[c])
    return np.linalg.lstsq(np.array(rows), np.array(want), rcond=None)[0]


def fill_gaps(turns: list[np.ndarray | None]) -> np.ndarray:
    """Rotations (T, 3, 3), interpolated by slerp in frames without one. turns: T of (3, 3) or None."""
    from scipy.spatial.transform import Rotation, Slerp

    known = [i for i, r in enumerate(turns) if r is not None]
    if not known:
        return np.tile(UPRIGHT, (len(turns), 1, 1))
    if len(known) == 1:
        return np.tile(turns[known[0]], (len(turns), 1, 1))
    slerp = Slerp(known, Rotation.from_matrix([turns[i] for i in known]))
    return slerp(np.clip(np.arange(len(turns)), known[0], known[-1])).as_matrix()


def estimate_start(body: Body, sightings: Sightings, focal: float, center: np.ndarray) -> State:
    """The trunk of each frame aligned and placed, arms hanging, betas zero. focal: px; center: (2,) px."""
    frames = len(sightings.xy)
    rest = body.keypoints(body.v_template)
    pelvis = body.J_regressor[0] @ body.v_template
    turns = [align_trunk(rest, sightings.world[t], sightings.xy[t], sightings.seen[t], focal, center) for t in range(frames)]
    turns = fill_gaps(turns)
    local = hang_arms(frames, 55, body.joint_names)
    local[:, 0] = turns
    transl = np.full((frames, 3), np.nan)
    for t in range(frames):
        use = [i for i in TRUNK if sightings.seen[t, i]]
        if len(use) >= 2:
            turned = (rest[use] - pelvis) @ turns[t].T + pelvis
            transl[t] = solve_transl(turned, sightings.xy[t, use], focal, center)
    known = np.isfinite(transl).all(1) & (np.nan_to_num(transl[:, 2]) > 0.3)
    if not known.any():
        transl[:], known[:] = [0, 0, focal * 1.7 / sightings.person_height], True
    for c in range(3):
        transl[:, c] = np.interp(np.arange(frames), np.nonzero(known)[0], transl[known, c])
    return State(local, transl, np.zeros(body.num_betas), float(np.log(focal)), np.zeros(3 * len(BODY_JOINTS) + 2))
