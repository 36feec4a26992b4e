"""The fit as one least-squares problem: residuals, cost and normal equations.

Residuals are in units of their own spread (standard deviation), so that weights are probabilities and not taste. Data terms are
robust (Geman-McClure), by iterated reweighting. T frames, P points, A active joints, n = 3 A + 3 unknowns a frame,
s = 1 + B + K + H + G shared ones: focal length, betas, the person's own offsets, the stance, the ground's level.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body
from gsac.stages.smplx import prior
from gsac.stages.smplx.jacobians import Chain, Pairs, Skeleton, place_points, pull_back
from gsac.stages.smplx.lm.ground import Ground
from gsac.stages.smplx.lm.observations import Observations
from gsac.stages.smplx.lm.person_offsets import PersonOffsets
from gsac.stages.smplx.lm.solver import System, levenberg_marquardt, robust
from gsac.stages.smplx.lm.stance import Stance
from gsac.stages.smplx.silhouette import INSET
from gsac.stages.smplx.state import State

ROBUST, OUTLINE_ROBUST = 3.0, 3.0
"""Robust limits of points and of outlines, in spreads; `Problem.limit` is wider while the body is far off."""
CLOTHES = 0.003
"""Distance, m, of the silhouette from a body model without clothes (an official SMPL-X file)."""
OUTLINE_SIGHTINGS = 60
"""Weight of one frame's outline, in independent points."""
INSIDE_ROBUST, INSIDE_SIGHTINGS = 15.0, 30.0
"""Robust limit, in spreads, and weight, in independent points, of one arm's points that lie inside the outline or cost."""


class Problem:
    """The least-squares problem of one clip over its active joints."""

    def __init__(self, body: Body, pairs: Pairs, hips: tuple[int, int], seen: Observations, active: np.ndarray,
                 smoothness: float, person_offsets: PersonOffsets | None = None):
        """pairs: of the observed points; hips: the two of them against which depths are measured; active: (A,) joints that turn."""
        self.body, self.pairs, self.hips, self.seen = body, pairs, hips, seen
        self.person_offsets = person_offsets
        self.skeleton = Skeleton(body, active, person_offsets.joints if person_offsets else None)
        self.own_spread = person_offsets.spread if person_offsets else np.zeros(0)
        self.active = active
        mean, spread = prior.pose_prior(active, body.hand_means)
        self.mean = np.tile(mean, (len(seen.xy), 1, 1))  # (T, A, 3)
        self.spread = np.tile(spread, (len(seen.xy), 1, 1))  # (T, A, 3)
        speed, acceleration = prior.motion_prior(active)
        self.speed_spread, self.acceleration_spread = speed, acceleration
        self.smoothness, self.outline_weight, self.limit = smoothness, 0.0, ROBUST
        self.transl_spread = np.full(3, prior.TRANSL_ACCELERATION)
        self.jumps = np.zeros(max(len(seen.xy) - 2, 0), bool)
        """(T - 2,) triples of frames in which the turn jumps: nothing holds the pelvis together there."""
        self.stance = Stance(active)
        self.ground: Ground | None = None
        self.inside: list[tuple[int, Pairs]] = []
        """Frames, and points of the surface that lie inside the outline or cost: of an arm that is not seen."""
        self.loose = np.ones((len(seen.xy), len(active)))
        """(T, A) factors on the spreads of speed and acceleration, 1 but where an arm makes a gesture."""
        self.outline_pairs: list[Pairs | None] = [None] * len(seen.xy)
        self.size = 3 * len(active) + 3
        top, sole = body.v_template[:, 1].argmax(), body.v_template[:, 1].argmin()
        self.height = float(body.v_template[top, 1] - body.v_template[sole, 1])
        self.height_dirs = (body.shapedirs[top, 1] - body.shapedirs[sole, 1]).astype(np.float64)
        self.height_dirs[body.num_figure:] = 0
        self.shape_mean, self.shape_spread = prior.shape_prior(body.num_figure, body.clothes)
        self.clothes = 0.0 if body.clothes else CLOTHES

    def minimise(self, state: State, iterations: int, frozen: np.ndarray | None = None,
                 frozen_shared: np.ndarray | None = None) -> tuple[State, int]:
        """Minimises the cost from a state. Returns state and number of steps.

        frozen: (n,) bool and frozen_shared: (s,) bool, unknowns that stay; none by default.
        """
        frozen = np.zeros(self.size, bool) if frozen is None else frozen
        frozen_shared = np.zeros(state.shared, bool) if frozen_shared is None else frozen_shared
        return levenberg_marquardt(state, self.linearise, self.cost, self.move, frozen, frozen_shared, iterations)

    def move(self, state: State, step: np.ndarray, shared: np.ndarray) -> State:
        """The state after a step (T, n) and a shared step (s,)."""
        local = state.local.copy()
        local[:, self.active] = local[:, self.active] @ rotation.exp(step[:, :-3].reshape(len(step), -1, 3))
        b, s = 1 + len(state.betas), 1 + len(state.shape)
        h = s + len(state.stance)
        return State(local, state.transl + step[:, -3:], state.betas + shared[1:b], state.log_focal + float(shared[0]),
                     state.stance + shared[s:h], state.own + shared[b:s], state.level + shared[h:])

    def project(self, state: State, x: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of points x (..., 3) m, camera frame."""
        return np.exp(state.log_focal) * x[..., :2] / np.maximum(x[..., 2:], 0.05) + self.seen.center

    def cost(self, state: State) -> float:
        """Sum of all terms."""
        chain = self.skeleton.pose(state.local, state.shape)
        total = 0.0
        x = self.locate_points(chain, state)
        total += robust(self._point_residual(self.project(state, x)), self.limit)[0].sum()
        total += robust(self._depth_residual(x), self.limit)[0].sum()
        for t, x in self.locate_outlines(chain, state):
            distance, _, inside = self.seen.outlines[t].at(self.project(state, x))
            scaled = np.where(inside, (distance + self._stand_off(t, state, x)[0]) / self.seen.outline_spread, 0)
            total += self._outline_share(len(x)) * robust(scaled, OUTLINE_ROBUST)[0].sum()
        vector = rotation.log(state.local[:, self.active])
        total += (self._prior_residual(vector) ** 2).sum() + (self._limit_residual(vector)[0] ** 2).sum()
        if len(state.stance):
            total += (self.stance.residual(state.local[:, self.active], vector, state.stance) ** 2).sum()
        for t, pairs in self.inside:
            residual, _ = self._outside(t, state, self._place(chain, state, t, pairs))
            total += INSIDE_SIGHTINGS / len(residual) * robust(residual, INSIDE_ROBUST)[0].sum()
        if len(state.level):
            total += self.ground.cost(chain, state.shape, state.transl, state.stance, state.level)
        total += sum((r**2).sum() for r in self._temporal_residuals(state, self._turns(state)[0]))
        return float(total + (self._shared_residual(state)[0] ** 2).sum())

    def linearise(self, state: State) -> System:
        """Normal equations of all terms."""
        chain = self.skeleton.pose(state.local, state.shape)
        system = self.linearise_frames(state, chain)
        self._add_temporal(system, state)
        if len(state.stance):
            local = state.local[:, self.active]
            self.stance.add(system, local, rotation.log(local), state.stance, len(state.shape) + 1)
        if len(state.level):
            self.ground.add(system, self.skeleton, chain, state.shape, state.transl, state.stance, state.level)
        residual, jacobian = self._shared_residual(state)
        system.add_shared(jacobian, residual)
        return system

    def linearise_frames(self, state: State, chain: Chain) -> System:
        """Normal equations of the terms that look at one frame alone: points, outlines, pose prior."""
        system = System.zeros(len(state.local), self.size, state.shared)
        self._add_points(system, state, chain)
        for t, x in self.locate_outlines(chain, state):
            self._add_outline(system, state, chain, t, x)
        for t, pairs in self.inside:
            self._add_inside(system, state, chain, t, pairs)
        self._add_prior(system, state)
        return system

    def locate_points(self, chain: Chain, state: State) -> np.ndarray:
        """(T, P, 3) m, the observed points, camera frame."""
        return place_points(chain, self.pairs, state.shape) + state.transl[:, None]

    def locate_outlines(self, chain: Chain, state: State) -> Iterator[tuple[int, np.ndarray]]:
        """Frame index and outline points (P, 3) m of each frame that has any."""
        if self.outline_weight > 0:
            for t, pairs in enumerate(self.outline_pairs):
                if pairs is not None:
                    yield t, self._place(chain, state, t, pairs)

    def _place(self, chain: Chain, state: State, t: int, pairs: Pairs) -> np.ndarray:
        """(P, 3) m, the pairs' points in one frame, camera frame."""
        return place_points(chain.frame(t), pairs, state.shape)[0] + state.transl[t]

    def _add_points(self, system: System, state: State, chain: Chain) -> None:
        """Adds points and their depths: two rows and one row a point."""
        x = self.locate_points(chain, state)
        uv = self.project(state, x)
        residual = self._point_residual(uv)
        shrink = robust(residual, self.limit)[1]
        weight = shrink / self.seen.spread[..., None]  # zero where a point was not seen
        depth = self._depth_residual(x)
        depth_shrink = np.where(np.isfinite(self.seen.depth), robust(depth, self.limit)[1], 0)
        covectors = np.zeros((*x.shape[:2], 3, 3))
        covectors[..., :2, :], covectors[..., 2, 2] = self._projection_slope(state, x), 1
        scale = np.concatenate([weight, (depth_shrink / self.seen.depth_spread)[..., None]], 2)
        rows = pull_back(self.skeleton, chain, self.pairs, state.shape, covectors)
        rows[:, :, 2] -= rows[:, list(self.hips), 2].mean(1, keepdims=True)
        jacobian, n = np.zeros((*rows.shape[:3], rows.shape[3] + 1)), self.size
        jacobian[..., :n], jacobian[..., :2, n], jacobian[..., n + 1:] = rows[..., :n], uv - self.seen.center, rows[..., n:]
        jacobian *= scale[..., None]
        values = np.concatenate([residual * shrink, (depth * depth_shrink)[..., None]], 2)
        system.add(slice(None), jacobian.reshape(len(x), -1, jacobian.shape[-1]), values.reshape(len(x), -1))

    def _projection_slope(self, state: State, x: np.ndarray) -> np.ndarray:
        """Derivative (..., 2, 3) of the pixels by x (..., 3) m."""
        f, z = np.exp(state.log_focal), np.maximum(x[..., 2], 0.05)
        out = np.zeros((*x.shape[:-1], 2, 3))
        out[..., 0, 0] = out[..., 1, 1] = f / z
        out[..., 0, 2], out[..., 1, 2] = -f * x[..., 0] / z**2, -f * x[..., 1] / z**2
        return out

    def _point_residual(self, uv: np.ndarray) -> np.ndarray:
        """(T, P, 2) in spreads; 0 where a point was not seen. uv: (T, P, 2) px."""
        known = np.isfinite(self.seen.spread)[..., None]
        return np.where(known, (uv - np.nan_to_num(self.seen.xy)) / self.seen.spread[..., None], 0)

    def _depth_residual(self, x: np.ndarray) -> np.ndarray:
        """(T, P) of the depths against the middle of the hips, in spreads; 0 where unknown. x: (T, P, 3) m."""
        model = x[..., 2] - x[:, list(self.hips), 2].mean(1, keepdims=True)
        return np.nan_to_num((model - self.seen.depth) / self.seen.depth_spread)

    def _outline_share(self, count: int) -> float:
        """Weight of one outline point: neighbours along an edge are not independent sightings."""
        return self.outline_weight * OUTLINE_SIGHTINGS / max(count, 1)

    def _stand_off(self, t: int, state: State, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (P,) px of the silhouette from outline points x (P, 3) m, and the part of it that scales with 1 / depth."""
        clothes = self.clothes * np.exp(state.log_focal) / np.maximum(x[:, 2], 0.05)
        return clothes + INSET * self.seen.outlines[t].scale, clothes

    def _add_outline(self, system: System, state: State, chain: Chain, t: int, x: np.ndarray) -> None:
        """Adds one frame's outline points x (P, 3) m: one row a point."""
        uv = self.project(state, x)
        distance, direction, inside = self.seen.outlines[t].at(uv)
        off, clothes = self._stand_off(t, state, x)
        residual = np.where(inside, (distance + off) / self.seen.outline_spread, 0)
        shrink = robust(residual, OUTLINE_ROBUST)[1] * np.sqrt(self._outline_share(len(x)))
        weight = np.where(inside, shrink / self.seen.outline_spread, 0)
        along = np.einsum("pc,pcd->pd", direction, self._projection_slope(state, x))  # (P, 3)
        along[:, 2] -= clothes / np.maximum(x[:, 2], 0.05)
        along *= weight[:, None]
        rows = pull_back(self.skeleton, chain.frame(t), self.outline_pairs[t], state.shape, along[None, :, None])[0, :, 0]
        focal = (((uv - self.seen.center) * direction).sum(1) + clothes) * weight
        system.add(slice(t, t + 1), np.insert(rows, self.size, focal, 1)[None], (residual * shrink)[None])

    def _outside(self, t: int, state: State, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (P,) of points x (P, 3) m outside the outline, in spreads, 0 inside, and its direction (P, 2) in the image."""
        distance, direction, inside = self.seen.outlines[t].at(self.project(state, x))
        out = inside & (distance > 0) & (self.seen.outlines[t].area > 0)
        return np.where(out, distance / self.seen.outline_spread, 0), direction

    def _add_inside(self, system: System, state: State, chain: Chain, t: int, pairs: Pairs) -> None:
        """Adds one frame's points that lie inside the outline or cost: one row a point. They leave the focal length alone."""
        x = self._place(chain, state, t, pairs)
        residual, direction = self._outside(t, state, x)
        weight = robust(residual, INSIDE_ROBUST)[1] * np.sqrt(INSIDE_SIGHTINGS / len(x))
        slope = np.where(residual > 0, weight / self.seen.outline_spread, 0)
        along = np.einsum("pc,pcd->pd", direction, self._projection_slope(state, x)) * slope[:, None]
        rows = pull_back(self.skeleton, chain.frame(t), pairs, state.shape, along[None, :, None])[0, :, 0]
        system.add(slice(t, t + 1), np.insert(rows, self.size, 0.0, 1)[None], (residual * weight)[None])

    def _prior_residual(self, vector: np.ndarray) -> np.ndarray:
        """(T, A, 3) in spreads. vector: (T, A, 3) rotation vectors of the active joints."""
        return (vector - self.mean) / self.spread

    def _limit_residual(self, vector: np.ndarray) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """Backward bend (T, L) of hinges, in spreads, and the limits that concern active joints. vector: (T, A, 3)."""
        where = {int(j): i for i, j in enumerate(self.active)}
        limits = [(where[j], axis, sign) for j, axis, sign in prior.LIMITS if j in where]
        if not limits:
            return np.zeros((len(vector), 0)), limits
        return np.stack([np.minimum(0, sign * vector[:, i, axis]) / prior.LIMIT_SPREAD for i, axis, sign in limits], 1), limits

    def _add_prior(self, system: System, state: State) -> None:
        """Adds pose prior and hinge limits."""
        vector = rotation.log(state.local[:, self.active])
        slope = rotation.log_derivative(vector) / self.spread[..., None]  # (T, A, 3, 3)
        residual = self._prior_residual(vector)
        for i in range(len(self.active)):
            block = slice(3 * i, 3 * i + 3)
            j = slope[:, i]
            system.band[:, block, block] += j.transpose(0, 2, 1) @ j
            system.gradient[:, block] += np.einsum("tab,ta->tb", j, residual[:, i])
        over, limits = self._limit_residual(vector)
        for k, (i, axis, sign) in enumerate(limits):
            row = np.where(over[:, k, None] < 0, sign * rotation.log_derivative(vector[:, i])[:, axis] / prior.LIMIT_SPREAD, 0)
            block = slice(3 * i, 3 * i + 3)
            system.band[:, block, block] += row[:, :, None] * row[:, None, :]
            system.gradient[:, block] += row * over[:, k, None]

    def _turns(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Rotation vectors (T - 1, A, 3) and matrices (T - 1, A, 3, 3) of the joints from each frame to the next."""
        local = state.local[:, self.active]
        relative = local[:-1].swapaxes(-1, -2) @ local[1:]
        return rotation.log(relative), relative

    def _temporal_residuals(self, state: State, vector: np.ndarray) -> list[np.ndarray]:
        """Speed and acceleration of the joints, and acceleration of transl, in spreads; empty for photos.

        vector: (T - 1, A, 3) rotation of each joint from frame to frame.
        """
        if self.seen.seconds is None or len(state.local) < 3 or self.smoothness == 0:
            return []
        gap = np.diff(self.seen.seconds)[:, None, None]
        turn = vector / gap
        span = 0.5 * (gap[1:] + gap[:-1])
        moved = np.diff(state.transl, axis=0)[:, None] / gap
        scale = np.sqrt(self.smoothness)
        speed_spread, acceleration_spread = self._motion_spreads()
        return [scale * turn / speed_spread[..., None],
                scale * np.diff(turn, axis=0) / span / acceleration_spread[..., None],
                scale * np.diff(moved, axis=0)[:, 0] / span[:, 0] / self._transl_spreads()]

    def _motion_spreads(self) -> tuple[np.ndarray, np.ndarray]:
        """Spreads of the joints' speed (T - 1, A) and acceleration (T - 2, A)."""
        pairs = np.maximum(self.loose[:-1], self.loose[1:])
        acceleration = self.acceleration_spread * np.maximum(pairs[:-1], pairs[1:])
        acceleration[np.ix_(self.jumps, self.active == 0)] = np.inf
        return self.speed_spread * pairs, acceleration

    def _transl_spreads(self) -> np.ndarray:
        """Spreads of the acceleration of transl (T - 2, 3)."""
        return np.where(self.jumps[:, None], np.inf, self.transl_spread)

    def _add_temporal(self, system: System, state: State) -> None:
        """Adds speeds and accelerations."""
        vector, relative = self._turns(state)
        residuals = self._temporal_residuals(state, vector)
        if not residuals:
            return
        speed, acceleration, transl = residuals
        speed_spread, acceleration_spread = (spread[..., None, None] for spread in self._motion_spreads())
        n, scale = self.size, np.sqrt(self.smoothness)
        gap = np.diff(self.seen.seconds)
        span = 0.5 * (gap[1:] + gap[:-1])
        slope = rotation.log_derivative(vector)  # by the later frame's step
        back = -slope @ relative.swapaxes(-1, -2)  # by the earlier frame's
        for i in range(len(self.active)):
            block = slice(3 * i, 3 * i + 3)
            if np.isfinite(self.speed_spread[i]):
                w = scale / speed_spread[:, i] / gap[:, None, None]
                self._couple(system, block, n, [back[:, i] * w, slope[:, i] * w], speed[:, i])
            w = scale / acceleration_spread[:, i] / span[:, None, None]
            first, second = w / gap[:-1, None, None], w / gap[1:, None, None]
            self._couple(system, block, n, [-back[:-1, i] * first, back[1:, i] * second - slope[:-1, i] * first,
                                            slope[1:, i] * second], acceleration[:, i])
        eye = np.eye(3)[None] * (scale / self._transl_spreads()[:, None] / span[:, None, None])
        first, second = eye / gap[:-1, None, None], eye / gap[1:, None, None]
        self._couple(system, slice(n - 3, n), n, [first, -first - second, second], transl)

    @staticmethod
    def _couple(system: System, block: slice, n: int, parts: list[np.ndarray], residual: np.ndarray) -> None:
        """Adds rows that couple the same unknowns of two or three adjacent frames. parts: (R, 3, 3) by frame; residual: (R, 3)."""
        rows = len(residual)
        for i, left in enumerate(parts):
            frames = slice(i, i + rows)
            system.gradient[frames, block] += np.einsum("rab,ra->rb", left, residual)
            for k, right in enumerate(parts[i:]):
                columns = slice(block.start + k * n, block.stop + k * n)
                system.band[frames, block, columns] += left.transpose(0, 2, 1) @ right

    def _shared_residual(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Priors of focal length, betas, own offsets, stance and height: residuals (R,) and rows (R, s).

        Frames of one view share their errors (clothes, the detector's), so that the priors count once for each repeat.
        """
        b, (focal, focal_spread), (metres, spread) = 1 + len(state.betas), self.seen.focal_prior, self.seen.height
        spreads = np.concatenate([[focal_spread], self.shape_spread, self.own_spread[:len(state.own)],
                                  self.stance.mean_spread[:len(state.stance)]])
        rows = np.concatenate([np.diag(1 / spreads), np.zeros((1, len(spreads)))])
        rows[-1, 1:b] = self.height_dirs / spread
        tall = self.height + self.height_dirs @ state.betas
        away = np.concatenate([[state.log_focal - np.log(focal)], state.betas - self.shape_mean, state.own,
                               state.stance - self.stance.mean[:len(state.stance)]])
        residual = np.append(away / spreads, (tall - metres) / spread)
        count = np.sqrt(self.seen.repeats)
        return residual * count, np.pad(rows * count, ((0, 0), (0, len(state.level))))


def estimate_joint_sigma(problem: Problem, state: State) -> np.ndarray:
    """Standard deviation (T, 55) m of each joint by its frame alone; unknowns are taken as independent."""
    chain = problem.skeleton.pose(state.local, state.shape)
    system = problem.linearise_frames(state, chain)
    n = problem.size
    information = system.band[:, np.arange(n), np.arange(n)]
    angle = 1 / np.sqrt(np.maximum(information[:, :-3].reshape(len(state.local), -1, 3).min(-1), 1e-6))
    place = np.sqrt(1 / np.maximum(information[:, -3:-1].min(-1), 1e-6))
    out = np.zeros(chain.place.shape[:2])
    index = {int(j): i for i, j in enumerate(problem.active)}
    for j, p in enumerate(problem.skeleton.parents):
        if p < 0:
            out[:, j] = place
            continue
        bone = np.linalg.norm(chain.place[:, j] - chain.place[:, p], axis=-1)
        turn = angle[:, index[p]] if p in index else 0.2
        out[:, j] = np.hypot(out[:, p], bone * turn)
    return out
