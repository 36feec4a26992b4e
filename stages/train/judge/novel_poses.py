"""Judges the avatar in poses that no clip of a turning person shows: alpha off the body, gaps on it, and needles.

Arms that hang beside the trunk while training are lifted, knees bend: gaussians that were hidden, or that painted a neighbouring
part, appear as fur and floaters.
"""

from __future__ import annotations

import cv2
import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import J, turn_joints
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.turned_body import turn_before_camera

POSES = {
    "T-pose": {},
    "arms up": {"shoulder": (0, 0, 60)},
    "arms forward": {"shoulder": (0, -70, 0)},
    "squat": {"hip": (-80, 0, 10), "knee": (90, 0, 0)},
    "stride": {"left_hip": (-45, 0, 0), "right_hip": (25, 0, 0), "left_knee": (30, 0, 0), "right_knee": (15, 0, 0)},
    "hands to the shoulders": {"shoulder": (0, -40, -40), "elbow": (0, -120, 0)},
    "wave": {"right_shoulder": (-70, 0, 10), "right_elbow": (0, 105, 0), "left_shoulder": (0, 0, -60)},
    "kneeling": {"hip": (-30, 0, 0), "knee": (115, 0, 0), "shoulder": (0, 0, -60)},
}
"""Degrees, axis-angle, on top of the T-pose; a joint without a side is both, mirrored."""
TURNS = (0, 90, 180, 270, 45)
"""Degrees about the upright axis of the views of each pose."""
OFF = 0.06
"""m that cloth and hair may stand off the body."""
RIM = 0.015
"""m inside of the silhouette's edge where the avatar may be thinner than the body."""
NEEDLE, LONG = 4.5, 0.02
"""Longest axis over the middle one, and m, above which a gaussian is a needle."""


def judge_novel(gaussians: Gaussians, poses: Poses) -> dict[str, float]:
    """`stray_alpha`: alpha farther than OFF outside of the body's silhouette, over the silhouette's area, in the worst view;
    `torn_alpha`: alpha missing farther than RIM inside of it, likewise; `needle_share`: share of gaussians that are needles,
    in the worst pose.
    """

    def of_pose(turns: dict, workspace: Workspace) -> tuple[float, float, float]:
        posed = pose_body(poses, turns)
        bound = bind(face_frames(posed, poses.body.faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
        axes = np.sort(bound.scales, 1)
        needles = float(((axes[:, 2] > NEEDLE * axes[:, 1]) & (2 * axes[:, 2] > LONG)).mean())
        stray = torn = 0.0
        for turn in TURNS:
            vertices, camera, metre = turn_before_camera(posed, turn)
            body = rasterise(vertices, poses.body.faces, camera)[0] >= 0
            near, deep = (change(body.astype(np.uint8), disc(int(np.ceil(metres * metre)))) > 0
                          for change, metres in ((cv2.dilate, OFF), (cv2.erode, RIM)))
            alpha = render_bound(vertices, poses.body.faces, gaussians, camera, workspace).alpha
            stray = max(stray, float(alpha[~near].sum() / max(body.sum(), 1)))
            torn = max(torn, float((1 - alpha)[deep].sum() / max(body.sum(), 1)))
        return stray, torn, needles

    stray, torn, needles = map(max, zip(*side_by_side(of_pose, POSES.values()), strict=True))
    return {"stray_alpha": stray, "torn_alpha": torn, "needle_share": needles}


def disc(radius: int) -> np.ndarray:
    """(2 radius + 1, 2 radius + 1) uint8, a disc of ones. radius: px."""
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))


def pose_body(poses: Poses, turns: dict[str, tuple[float, float, float]]) -> np.ndarray:
    """(V, 3) m, the canonical body with some joints turned, as `turn_joints` takes them."""
    return poses.body.bend(*poses.rest(0), turn_joints(np.zeros((J, 3)), turns))
