"""Gaussians that still leave the body where a joint bends, bound to whatever face: drawn in until they no longer show off it.

The face of an armpit, an elbow or a knee grows as the joint bends, and with it grows what it carries: the size of a gaussian, and
how high it stands over the face. So what stands above the surface around is lowered to it, and shrinks only if it still shows. A
handful of gaussians makes most of the fringe: few enough that the clip's own frames do not miss what they lose.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from gsac.avatar.binding import bind
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise
from gsac.stages.train.config import FULL_SIZE
from gsac.stages.train.gaussians.added_alpha import added_alpha
from gsac.stages.train.gaussians.bends import BENDS, Placed, place, put_in_pose, usual_pose
from gsac.stages.train.gaussians.heights import find_heights
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.poses.turned_body import turn_before_camera

TURNS = 3
"""Sides that each pose is looked at from."""
OFF = 0.012
"""m off the body from which alpha of `FULL_SIZE` gaussians begins to count (fewer are wider); from twice as far all does."""
LEAST = 2e-5
"""Stray alpha of a gaussian in a bent pose, over the silhouettes' area, that is too much."""
GROWN = 0.005
"""m farther from the body than in the clip's usual pose that a gaussian has to reach there: hair, shoes and wide clothes stay."""
HIGH = 0.001
"""m above the surface around, in the usual pose, from which on a stray is lowered; one that lies on it shrinks."""
ROUNDS, LOWERED, SHRUNK = 8, 0.7, 0.85
"""Rounds, at most; the share of its height over the surface that one takes, and the factor of one on standard deviations."""


class Side(NamedTuple):
    """A posed body, seen from one side."""

    vertices: np.ndarray
    """(V, 3) m, camera frame."""
    camera: Camera
    away: np.ndarray
    """(h, w) m off the silhouette."""
    area: int
    """Pixels of the silhouette, at least 1."""


class Bent(NamedTuple):
    """A posed body, and how it looks."""

    surface: Placed
    sides: list[Side]


class BentSilhouettes(NamedTuple):
    """The body's surface in the clip's usual pose, and how the body looks in its bends."""

    faces: np.ndarray
    """(F, 3)."""
    usual: Placed
    bent: list[Bent]


def bend_silhouettes(poses: Poses, frames: np.ndarray) -> BentSilhouettes:
    """The silhouettes as `BENDS` have them. frames: (n,) trained ones, whose median pose is the usual one."""
    pose, faces = usual_pose(poses.pose, frames), poses.body.faces
    bent = side_by_side(lambda turns, _: see(put_in_pose(poses, int(frames[0]), turn_joints(pose, turns)), faces), BENDS)
    return BentSilhouettes(faces, place(put_in_pose(poses, int(frames[0]), pose), faces), bent)


def draw_in_strays(gaussians: Gaussians, seen: BentSilhouettes) -> Gaussians:
    """The gaussians, some lower or smaller."""
    faces, usual, left = seen
    out = gaussians[np.arange(len(gaussians))]
    size, surface = np.maximum(usual.frames.k[gaussians.face], 1e-9), find_heights(gaussians, usual.frames)[1]

    def find_large(item: tuple[Bent, np.ndarray], _: Workspace) -> np.ndarray:
        posed, stray = item
        large = np.flatnonzero(stray > LEAST)
        return large[find_reach(out[large], posed.surface) > find_reach(out[large], usual) + GROWN]

    for _ in range(ROUNDS):
        shown = side_by_side(lambda side, workspace: find_stray(out, side, faces, workspace),
                             [side for posed in left for side in posed.sides])
        sums = [sum(shown[TURNS * k:TURNS * (k + 1)], np.zeros(len(out))) for k in range(len(left))]
        found = side_by_side(find_large, zip(left, sums, strict=True))
        left = [posed for posed, large in zip(left, found, strict=True) if len(large)]
        if not left:
            break
        stray = np.unique(np.concatenate(found))
        above = size[stray] * out.mu[stray, 1] - surface[stray]
        high = above > HIGH
        out.mu[stray[high], 1] -= LOWERED * above[high] / size[stray[high]]
        out.log_scale[stray[~high]] += np.float32(np.log(SHRUNK))
    return out


def see(posed: np.ndarray, faces: np.ndarray) -> Bent:
    """The body posed (V, 3) m from all sides. faces: (F, 3)."""
    sides = []
    for side in range(TURNS):
        vertices, camera, metre = turn_before_camera(posed, 360 * side / TURNS)
        body = rasterise(vertices, faces, camera)[0] >= 0
        away = cv2.distanceTransform((~body).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) / metre
        sides.append(Side(vertices, camera, away, max(int(np.count_nonzero(body)), 1)))
    return Bent(place(posed, faces), sides)


def find_stray(gaussians: Gaussians, side: Side, faces: np.ndarray, workspace: Workspace) -> np.ndarray:
    """(N,) alpha that each gaussian adds off the silhouette of the body, over its area, seen from a side. faces: (F, 3)."""
    off = OFF * max(1.0, FULL_SIZE / len(gaussians)) ** 0.5
    rendering = render_bound(side.vertices, faces, gaussians, side.camera, workspace)
    return added_alpha(rendering, np.clip(side.away / off - 1, 0, 1)) / side.area


def find_reach(gaussians: Gaussians, surface: Placed) -> np.ndarray:
    """(N,) m from the body to the ends of the gaussians: of the centre from its vertices, and the longest axis."""
    bound = bind(surface.frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    return surface.tree.query(bound.means)[0] + bound.scales.max(1)
