"""Gaussians that still leave the body where a joint bends, bound to whatever face: shrunk until they no longer show off it.

The face of an armpit, an elbow or a knee grows as the joint bends, and what it carries grows with it. A handful of gaussians makes
most of the fringe: few enough that the clip's own frames do not miss what they lose.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.raster import render_backward, render_bound
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise
from gsac.stages.train.config import FULL_SIZE
from gsac.stages.train.gaussians.joint_faces import BENDS
from gsac.stages.train.judge.novel_poses import turn_before_camera
from gsac.stages.train.poses.poses import Poses

TURNS = 3
"""Sides that each pose is looked at from."""
OFF = 0.022
"""m off the body from which alpha of `FULL_SIZE` gaussians begins to count (fewer are wider); from twice as far all does."""
LEAST = 2e-5
"""Stray alpha of a gaussian in a bent pose, over the silhouettes' area, that is too much."""
GROWN = 0.005
"""m farther from the body than in the clip's usual pose that a gaussian has to reach there: hair, shoes and wide clothes stay."""
ROUNDS, SHRUNK = 4, 0.75
"""Rounds that shrink what strays, and the factor of one on its standard deviations."""


def shrink_strays(gaussians: Gaussians, poses: Poses, frames: np.ndarray) -> Gaussians:
    """The gaussians, some smaller. frames: (n,) trained ones, whose median pose is the usual one."""
    pose, faces = np.median(poses.pose[frames], 0), poses.body.faces
    pose[0] = 0
    usual = put_in_pose(poses, int(frames[0]), pose)
    bent = [put_in_pose(poses, int(frames[0]), turn_joints(pose, turns)) for turns in BENDS]
    out = gaussians[np.arange(len(gaussians))]

    def find_large(posed: np.ndarray, workspace: Workspace) -> np.ndarray:
        large = np.flatnonzero(find_stray(out, posed, faces, workspace) > LEAST)
        return large[find_reach(out[large], posed, faces) > find_reach(out[large], usual, faces) + GROWN]

    for _ in range(ROUNDS):
        found = side_by_side(find_large, bent)
        bent = [posed for posed, large in zip(bent, found, strict=True) if len(large)]
        if not bent:
            break
        out.log_scale[np.unique(np.concatenate(found))] += np.float32(np.log(SHRUNK))
    return out


def find_stray(gaussians: Gaussians, posed: np.ndarray, faces: np.ndarray, workspace: Workspace) -> np.ndarray:
    """(N,) alpha that each gaussian adds off the silhouette of the body posed (V, 3) m, over its area, sum over the sides.

    What it adds is the gradient of a sum of pixels by its colour. faces: (F, 3).
    """
    stray, off = np.zeros(len(gaussians)), OFF * max(1.0, FULL_SIZE / len(gaussians)) ** 0.5
    for side in range(TURNS):
        vertices, camera, metre = turn_before_camera(posed, 360 * side / TURNS)
        body = rasterise(vertices, faces, camera)[0] >= 0
        away = cv2.distanceTransform((~body).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) / metre
        counted = np.clip(away / off - 1, 0, 1)[..., None].astype(np.float32).repeat(3, 2)
        rendering = render_bound(vertices, faces, gaussians, camera, workspace)
        added = render_backward(rendering.state, counted, np.zeros_like(rendering.alpha)).rgb[:, 0]
        stray += added / max(np.count_nonzero(body), 1)
    return stray


def find_reach(gaussians: Gaussians, posed: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N,) m from the body posed (V, 3) m to the ends of the gaussians: of the centre from its vertices, and the longest axis.

    faces: (F, 3).
    """
    bound = bind(face_frames(posed, faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    return KDTree(posed).query(bound.means)[0] + bound.scales.max(1)


def put_in_pose(poses: Poses, t: int, pose: np.ndarray) -> np.ndarray:
    """(V, 3) m, the body of frame t in another pose, (55, 3) axis-angle."""
    return poses.body.bend(*poses.rest(t), pose)
