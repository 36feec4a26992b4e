"""The path of an arm through the poses that people can take, as points, mask and the body's own surface tell it.

A search that goes downhill ends in the next best pose: an arm that hangs in the fit does not find its way over the head. So each
frame weighs poses from all over what shoulder and elbow can do. A pose is good that lies at its points, inside the mask, over the
mask's parts that the rest of the body leaves, and not inside the body; a hand that is seen lies before the body, one that is not
is most likely hidden by it and touches it. Of all sequences of such poses the cheapest is taken: an arm rests, or goes quickly.
F frames, K poses, S places, N points of the surface; sides are 0 left, 1 right.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from scipy.spatial import KDTree

from gsac.avatar import rotation
from gsac.avatar.directions import spread_directions
from gsac.avatar.joints import INDEX, J
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.zbuffer import rasterise
from gsac.stages.smplx import prior
from gsac.stages.smplx.lm.hidden_arms import ARM_JOINTS, ELBOW, HAND, HANDS, SIDES, WRIST
from gsac.stages.smplx.lm.problem import INSIDE_SIGHTINGS, Problem
from gsac.stages.smplx.lm.solver import robust
from gsac.stages.smplx.state import State, to_params

DIRECTIONS, TWISTS, BENDS = 200, np.radians(np.arange(0, 360, 36)), np.radians((5, 35, 65, 95, 120, 140))
"""Of the poses: directions of the upper arm, its turns about itself, bends of the elbow."""
LIKELY = 20.0
"""Squared distance, in spreads, of a pose from the mean one, at most."""
MOVES, FINER = 100, np.radians((16, 10, 6, 4, 2))
"""Small moves that a path tries in each frame, and their sizes, one after the other."""
MOVE = np.array([(0.7, 1, 1), (0.7, 1, 0.05), (0.2, 0.5, 0.5)])
"""Shares of those about the axes of shoulder, elbow and wrist: an elbow is a hinge, a forearm turns about itself."""
WEIGHED, KEPT = 1200, 120
"""Poses of a frame, the best by points and mask, that are weighed against the body; and of these that paths go through."""
ASTRAY = 6.0
"""Robust limit of points, in spreads: the detector takes the other arm, or cloth, for a hidden one."""
BESIDE, SLACK, SPREAD = 3.0, 0.008, 0.01
"""Of middle lines outside the mask, and of the mask outside a limb: robust limit, in spreads, and what is free and the spread,
as shares of the person's height."""
LEFT, LEFT_SHARE, SAMPLES = 0.02, 0.008, 60
"""Of the mask's parts that the body leaves: distance from it, and the area of a whole arm, as shares of the person's height and its
square; places at most."""
RADIUS = (0.048, 0.04, 0.05)
"""m, of upper arm, forearm and hand."""
THIN, BARE = (0.0,) * 4, (0.035, 0.025, 0.035, 0.03)
"""m about elbow, wrist, the forearm's middle and the knuckles that lie inside the mask: of middle lines alone, and of the skin."""
OFF, SINKS, SUNK = 0.02, 0.02, 60.0
"""m off the surface at which middle lines of forearm and hand lie when they touch it; spread, and the most that a pose inside
the body costs."""
TOUCHES, APART = 0.06, 2.0
"""Spread, m, and robust limit, in spreads, of a hand that is not seen from the body: most likely it touches it."""
BEHIND = 0.03
"""m behind the body's surface from which on a hand is hidden."""
BLIND, MISSED = 12.0, 4.0
"""Cost of a hand that is seen where the body hides it, and of one in plain view that is not seen."""
STILL, RESTS = 0.4, 4.0
"""Factor on the spread of an arm's speed, its robust limit, in spreads: who turns shows a resting arm from all sides."""
QUICKEST, QUICKER = 8.0, 2.0
"""rad/s, speed of shoulder or elbow beyond which a gesture is too quick to be one, and its spread."""

SURE = 0.15
"""rad, spread of shoulder and elbow about where they are in a frame in which they are no doubt."""


@dataclass
class Around:
    """What one frame shows around an arm: the body without it."""

    depth: np.ndarray  # (h, w) m of its surface, inf where there is none
    scale: float
    """px of the frame per pixel."""
    surface: KDTree
    normals: np.ndarray  # (N, 3) of the surface's points
    left: np.ndarray  # (S, 2) px, places of the mask that the body leaves
    weight: float
    """Of those places, all together, in independent points."""

    def measure_clearance(self, x: np.ndarray) -> np.ndarray:
        """Distance (...) m from the surface of points x (..., 3) m, negative inside the body."""
        _, index = self.surface.query(x)
        return ((x - np.asarray(self.surface.data)[index]) * self.normals[index]).sum(-1)

    def hides(self, xy: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """(K,) bool, whether the body lies before points. xy: (K, 2) px; depth: (K,) m."""
        h, w = self.depth.shape
        at = np.floor(xy / self.scale).astype(int)
        inside = (at >= 0).all(1) & (at < (w, h)).all(1)
        at = np.clip(at, 0, (w - 1, h - 1))
        return inside & (depth > self.depth[at[:, 1], at[:, 0]] + BEHIND)


class ArmPaths:
    """Paths of one arm through the frames of its own problem; all else keeps still."""

    def __init__(self, alone: Problem, state: State, side: int, shown: np.ndarray, sure: np.ndarray, height: float,
                 bare: tuple[float, ...] = THIN):
        """alone: the arm's problem; shown: (F,) bool, of the hand; sure: (F,) bool, frames in which the arm is not doubtful;
        height: px, of the person; bare: THIN or BARE."""
        self.alone, self.state, self.side, self.shown, self.sure, self.height = alone, state, side, shown, sure, height
        self.bare = bare
        self.chain = alone.skeleton.pose(state.local, state.shape)
        self.hips = alone.locate_points(self.chain, state)[:, list(alone.hips), 2].mean(1)
        self.around = look_around(alone, state, side, height)
        rest = alone.skeleton.rest + alone.skeleton.rest_dirs @ state.shape[: alone.skeleton.rest_dirs.shape[2]]
        self.bones = np.diff(rest[[*ARM_JOINTS[side, 1:], INDEX[f"{SIDES[side]}_middle1"]]], axis=0)

    def find(self, known: list[np.ndarray]) -> np.ndarray:
        """Joint rotations (F, J, 3, 3) of the cheapest path. known: rotations (F, J, 3, 3) whose poses may be part of it."""
        poses = []
        for t in range(len(self.shown)):
            own = list_poses(self.side)
            best = np.argsort(self.weigh_alone(t, own), kind="stable")[:WEIGHED]
            own = np.concatenate([own[best], np.stack([local[t, ARM_JOINTS[self.side, 1:]] for local in known])])
            poses.append(own[np.argsort(self.weigh(t, own), kind="stable")[:KEPT]])
        path = self.walk(poses)
        moves = np.random.default_rng(0).normal(size=(len(FINER), MOVES, 3, 3)) * MOVE
        for size, own in zip(FINER, moves, strict=True):
            turns = rotation.exp(size * own)
            path = self.walk([np.concatenate([path[max(t - 1, 0):t + 2], path[t] @ turns]) for t in range(len(path))])
        out = self.state.local.copy()
        out[:, ARM_JOINTS[self.side, 1:]] = path
        return out

    def walk(self, poses: list[np.ndarray]) -> np.ndarray:
        """(F, 3, 3, 3) the cheapest path through poses, (K, 3, 3, 3) of each frame, by dynamic programming (Viterbi 1967)."""
        total, back = self.weigh(0, poses[0]), []
        for t in range(1, len(poses)):
            whole = total[:, None] + self.measure_motion(t, poses[t - 1][:, None], poses[t][None])
            back.append(whole.argmin(0))
            total = whole.min(0) + self.weigh(t, poses[t])
        picked = [int(total.argmin())]
        for step in reversed(back):
            picked.append(int(step[picked[-1]]))
        return np.stack([own[k] for own, k in zip(poses, reversed(picked), strict=True)])

    def cost(self, local: np.ndarray) -> float:
        """Of the path of local, (F, J, 3, 3) joint rotations, whose collar bones may have moved too."""
        poses, moved = local[:, ARM_JOINTS[self.side, 1:]], copy(self)
        moved.chain = self.alone.skeleton.pose(local, self.state.shape)
        motion = sum(float(self.measure_motion(t, poses[t - 1], poses[t])) for t in range(1, len(poses)))
        return motion + sum(float(moved.weigh(t, pose[None])[0]) for t, pose in enumerate(poses))

    def measure_apart(self, local: np.ndarray, frames: range) -> float:
        """Cost of a hand that should rest on the body and lies apart from it. local: (F, J, 3, 3) joint rotations."""
        poses = local[:, ARM_JOINTS[self.side, 1:]]
        clear = np.array([self.around[t].measure_clearance(self.place(t, poses[t][None])[0, 3]) for t in frames])
        return float(((np.maximum(clear - 2 * OFF, 0) / TOUCHES) ** 2).sum())

    def measure_motion(self, t: int, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Cost (...) of the motion from frame t - 1 to t. before, after: (..., 3, 3, 3) rotations."""
        angle = measure_turns(before[..., :2, :, :], after[..., :2, :, :])
        seconds = self.alone.seen.seconds
        assert seconds is not None  # without times no arm moves
        speed = angle / (seconds[t] - seconds[t - 1])
        quick = np.maximum(speed - QUICKEST, 0) / QUICKER
        return robust(speed / (STILL * self.alone.speed_spread[1:3]), RESTS)[0].sum(-1) + (quick**2).sum(-1)

    def place(self, t: int, poses: np.ndarray) -> np.ndarray:
        """(K, 4, 3) m, shoulder, elbow, wrist and middle knuckle. poses: (K, 3, 3, 3) rotations of shoulder, elbow and wrist."""
        arm = ARM_JOINTS[self.side]
        upper = self.chain.world[t, arm[0]] @ poses[:, 0]
        lower = upper @ poses[:, 1]
        steps = np.stack([upper @ self.bones[0], lower @ self.bones[1], lower @ poses[:, 2] @ self.bones[2]], 1)
        shoulder = self.chain.place[t, arm[1]] + self.state.transl[t]
        return shoulder + np.concatenate([np.zeros((len(poses), 1, 3)), steps.cumsum(1)], 1)

    def weigh_alone(self, t: int, poses: np.ndarray) -> np.ndarray:
        """(K,) cost of a frame's poses by points, pose prior and mask. poses: (K, 3, 3, 3)."""
        alone, seen, rows = self.alone, self.alone.seen, [ELBOW[self.side], WRIST[self.side], HAND[self.side][3]]
        x = self.place(t, poses)
        xy, spread = alone.project(self.state, x[:, 1:]), seen.spread[t, rows, None]
        points = np.where(np.isfinite(spread), (xy - np.nan_to_num(seen.xy[t, rows])) / spread, 0)
        spread = np.broadcast_to(seen.depth_spread, seen.depth.shape)[t, rows]
        depths = np.nan_to_num((x[:, 1:, 2] - self.hips[t] - seen.depth[t, rows]) / spread)
        bends = (rotation.log(poses) - alone.mean[t, 1:]) / alone.spread[t, 1:]
        out = robust(points, ASTRAY)[0].sum((1, 2)) + robust(depths, ASTRAY)[0].sum(1) + (bends**2).sum((1, 2))
        if self.sure[t]:
            turns = measure_turns(poses[:, :2], self.state.local[t, ARM_JOINTS[self.side, 1:3]])
            out += robust(turns / SURE, RESTS)[0].sum(1)
        if seen.outlines and seen.outlines[t].area > 0:
            lower = x[:, 1:3]
            size = np.exp(self.state.log_focal) / x[:, 1, 2]
            outside = []
            for place, bare in zip((*lower.swapaxes(0, 1), lower.mean(1), x[:, 3]), self.bare, strict=True):
                distance, _, judged = seen.outlines[t].at(alone.project(self.state, place))
                outside.append(np.where(judged, distance + size * bare, 0))
            outside = np.stack(outside, 1) / self.height
            out += INSIDE_SIGHTINGS * robust(np.maximum(outside - SLACK, 0) / SPREAD, BESIDE)[0].mean(1)
        return out

    def weigh(self, t: int, poses: np.ndarray) -> np.ndarray:
        """(K,) cost of a frame's poses, also by what the rest of the body leaves of the mask, touches and hides."""
        x, around = self.place(t, poses), self.around[t]
        out = self.weigh_alone(t, poses)
        xy = self.alone.project(self.state, x)
        if len(around.left):
            size = np.exp(self.state.log_focal) / x[0, 0, 2] * np.array(RADIUS)
            off = np.min([measure_gap(xy[:, k], xy[:, k + 1], around.left) - size[k] for k in range(3)], axis=0)
            out += around.weight * robust(np.maximum(off / self.height - SLACK, 0) / SPREAD, BESIDE)[0].mean(1)
        clear = around.measure_clearance(np.stack([x[:, 1:3].mean(1), x[:, 2], x[:, 3]], 1))
        out += np.minimum((np.minimum((clear - OFF) / SINKS, 0) ** 2).sum(1), SUNK)
        hidden = around.hides(xy[:, 3], x[:, 3, 2])
        if self.shown[t]:
            return out + BLIND * hidden
        return out + MISSED * ~hidden + robust(np.maximum(clear[:, 2] - 2 * OFF, 0) / TOUCHES, APART)[0]


@cache
def list_poses(side: int) -> np.ndarray:
    """(K, 3, 3, 3) rotations of shoulder and elbow from all over what people can do, and of a straight wrist."""
    way, bone = spread_directions(DIRECTIONS, 0.5)[:, [0, 2, 1]], np.array([1.0, 0, 0])
    axis = np.cross(bone, way)
    swing = rotation.exp(axis / np.linalg.norm(axis, axis=1, keepdims=True) * np.arccos(way[:, :1]))
    shoulder = swing[:, None] @ rotation.exp(TWISTS[:, None] * bone)
    elbow = rotation.exp(-BENDS[:, None] * (0, 1, 0))
    mean, spread = prior.pose_prior(ARM_JOINTS[0, 1:3])
    first, second = ((((rotation.log(r) - mean[k]) / spread[k]) ** 2).sum(-1) for k, r in enumerate((shoulder, elbow)))
    direction, twist, bend = np.nonzero(first[..., None] + second < LIKELY)
    out = np.stack([shoulder[direction, twist], elbow[bend], np.tile(np.eye(3), (len(bend), 1, 1))], 1)
    flip = np.diag([-1.0, 1, 1])
    return out if side == 0 else flip @ out @ flip


def measure_turns(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Angles (...) rad between rotations before (..., 3, 3) and after (..., 3, 3)."""
    return np.arccos(np.clip((np.einsum("...ab,...ab->...", before, after) - 1) / 2, -1, 1))


def measure_gap(start: np.ndarray, end: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(K, S) distances of places (S, 2) from the lines between start and end (K, 2)."""
    off, along = places - start[:, None], (end - start)[:, None]
    share = np.clip((off * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-9), 0, 1)
    return np.linalg.norm(off - share[..., None] * along, axis=-1)


def look_around(alone: Problem, state: State, side: int, height: float) -> list[Around]:
    """What each frame shows around an arm. height: px, of the person."""
    body, offsets, out = alone.body, alone.person_offsets, []
    assert offsets is not None  # only an arm's or a hand's own problem may lack them
    arm = np.asarray(body.weights)[:, [*ARM_JOINTS[side, 1:], *np.arange(J)[HANDS[side]]]].sum(1) > 0.5
    faces = body.faces[~arm[body.faces].any(1)]
    surface = np.unique(faces)[::6]
    params = to_params(body, state, alone.seen.center, joint_offset=offsets.joint_offset(state.own))
    for vertices, outline in zip(body.posed(params)[0], alone.seen.outlines, strict=True):
        h, w = outline.mask.shape
        camera = params.camera(round(w * outline.scale), round(h * outline.scale)).scaled(w, h)
        depth, pixel = rasterise(vertices, faces, camera)[2], outline.scale / height
        away = cv2.distanceTransform(np.isinf(depth).astype(np.uint8), cv2.DIST_L2, 5)
        y, x = np.nonzero(outline.mask & (away * pixel > LEFT))
        some = np.linspace(0, len(y), min(len(y), SAMPLES), endpoint=False).astype(int)
        share = min(len(y) * pixel**2 / LEFT_SHARE, 2.0)
        out.append(Around(depth, outline.scale, KDTree(vertices[surface]), vertex_normals(vertices, body.faces)[surface],
                          (np.stack([x, y], 1)[some] + 0.5) * outline.scale, INSIDE_SIGHTINGS * share))
    return out
