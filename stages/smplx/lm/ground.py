"""Ground contact: soles lie flat on one plane or above it, and a foot at rest in the image does not slide.

The plane is normal to the clip's upright (stance.py); its height is an unknown of the clip. The loss is robust, so that a lifted
foot is released. T frames, P = 8 points of the soles (inner and outer edge of heel and ball of each foot), n unknowns a frame,
S shape unknowns (`shape`), H of the stance (`stance`), 1 of the ground (`level`, m along the upright).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.ndimage import uniform_filter1d

from gsac.avatar.body import Body
from gsac.avatar.wholebody import INDEX
from gsac.stages.smplx.jacobians import Chain, Pairs, Skeleton, make_pairs, place_points, pull_back
from gsac.stages.smplx.lm.solver import System, robust
from gsac.stages.smplx.lm.stance import upright

FEET = tuple((f"{side}_ankle", f"{side}_foot") for side in ("left", "right"))
SEEN = tuple((INDEX[f"{side}_heel"], INDEX[f"{side}_big_toe"]) for side in ("left", "right"))
OFF = 0.010
"""Spread, m, of a resting sole's height over the plane: shoes, bare soles that roll."""
TILT = 0.004
"""Spread, m, of the height of one edge of a sole over the other: three degrees."""
LIFTED, SUNK = 2.0, 4.0
"""Robust limits above and below the ground, in spreads: a foot may be lifted, and the camera may be moved."""
SOLE = 0.008
"""Thickness of the sole above a foot's lowest vertex, m."""
SLIDE = 0.03
"""Spread of the speed of a foot at rest, m/s."""
SLIPPED = 3.0
"""Robust limit of that speed, in spreads."""
PACE = 0.04
"""Speed in the image, person's heights a second, at which heel and toes rest with probability 1/2; steps are faster."""
WINDOW = 3
"""Frames over which the detector's jitter is averaged."""


class Ground:
    """The terms of one clip."""

    def __init__(self, body: Body, weight: float = 1.0):
        """weight: of the height and the slip term."""
        self.pairs = find_soles(body)
        self.scale = np.sqrt(weight)
        half = np.eye(self.pairs.count // 2)
        self.flat = np.concatenate([np.kron(half, [[0.5, 0.5]]) / OFF, np.kron(half, [[1, -1]]) / TILT]) * self.scale
        """(P, P) from heights of the points to heights of their pairs' middles, then of one edge over the other, in spreads."""
        self.rest = np.zeros((0, self.pairs.count))  # (T - 1, P) square root of the information, s/m

    def find_resting_feet(self, xy: np.ndarray, seen: np.ndarray, seconds: np.ndarray | None, height: float) -> None:
        """Finds which feet rest in which frames; without times none do.

        xy: (T, 133, 2) px; seen: (T, 133) bool; seconds: (T,); height: px, of the person.
        """
        if seconds is None or len(xy) < WINDOW:
            return
        feet = np.stack([rate_rest(xy[:, points] / height, seen[:, points], seconds) for points in SEEN], 1)  # (T, 2)
        both = np.repeat(np.minimum(feet[:-1], feet[1:]), 4, axis=1) / 2  # two edges share what is known of a sole
        self.rest = np.sqrt(both) / SLIDE / np.diff(seconds)[:, None]

    def estimate_level(self, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray) -> np.ndarray:
        """Initial level (1,) m: median of each frame's lowest sole. shape: (S,); transl: (T, 3) m; stance: (H,)."""
        return np.median(self._heights(chain, shape, transl, stance).min(1))[None]

    def cost(self, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray, level: np.ndarray) -> float:
        """Robust cost of both terms. shape: (S,); transl: (T, 3) m; stance: (H,); level: (1,) m."""
        x = place_points(chain, self.pairs, shape) + transl[:, None]
        off, slip = self._height_residual(x, stance, level), self._slip_residual(x)
        return float(_robust_height(off)[0].sum() + robust(slip, SLIPPED)[0].sum())

    def add(self, system: System, skeleton: Skeleton, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray,
            level: np.ndarray) -> None:
        """Adds both terms to the normal equations, whose shared unknowns are focal, shape, stance, level.

        shape: (S,); transl: (T, 3) m; stance: (H,); level: (1,) m.
        """
        x = place_points(chain, self.pairs, shape) + transl[:, None]
        n, first = system.gradient.shape[1], 1 + len(shape)
        up, by_slope = upright(stance)
        off = self._height_residual(x, stance, level)
        shrink = _robust_height(off)[1]
        rows = pull_back(skeleton, chain, self.pairs, shape, np.broadcast_to(up, (*x.shape[:2], 1, 3)))[:, :, 0]
        jacobian = np.zeros((*x.shape[:2], n + first + len(stance) + 1))
        jacobian[..., :n], jacobian[..., n + 1: n + 1 + rows.shape[2] - n] = rows[..., :n], rows[..., n:]
        jacobian[..., -3:-1], jacobian[..., -1] = x @ by_slope, -1
        system.add(slice(None), self.flat @ jacobian * shrink[..., None], off * shrink)
        if self.rest.any():
            axes = np.broadcast_to(np.eye(3), (*x.shape[:2], 3, 3))
            self._add_slip(system, pull_back(skeleton, chain, self.pairs, shape, axes), x)

    def _add_slip(self, system: System, rows: np.ndarray, x: np.ndarray) -> None:
        """Adds the slip term. rows: (T, P, 3, n + S') Jacobian of the points x (T, P, 3) m."""
        slip = self._slip_residual(x)
        shrink = robust(slip, SLIPPED)[1]
        weight = (shrink * self.rest[..., None] * self.scale)[..., None]
        n, residual = system.gradient.shape[1], (slip * shrink).reshape(len(slip), -1, 1)
        before, after = ((sign * r * weight).reshape(len(slip), -1, r.shape[-1]) for sign, r in ((-1, rows[:-1]), (1, rows[1:])))
        by_shape = before[..., n:] + after[..., n:]
        first, second, shared = before[..., :n].swapaxes(1, 2), after[..., :n].swapaxes(1, 2), slice(1, 1 + by_shape.shape[2])
        system.band[:-1, :, :n] += first @ before[..., :n]
        system.band[:-1, :, n: 2 * n] += first @ after[..., :n]
        system.band[1:, :, :n] += second @ after[..., :n]
        system.gradient[:-1] += (first @ residual)[..., 0]
        system.gradient[1:] += (second @ residual)[..., 0]
        system.arrow[:-1, :, shared] += first @ by_shape
        system.arrow[1:, :, shared] += second @ by_shape
        system.shared[shared, shared] += np.einsum("tra,trb->ab", by_shape, by_shape)
        system.shared_gradient[shared] += np.einsum("tra,tr->a", by_shape, residual[..., 0])

    def _heights(self, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray) -> np.ndarray:
        """(T, P) m along the upright."""
        return (place_points(chain, self.pairs, shape) + transl[:, None]) @ upright(stance)[0]

    def _height_residual(self, x: np.ndarray, stance: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Residuals (T, P): heights of the middles over the plane, of one edge over the other, in spreads."""
        return (x @ upright(stance)[0] - level[0]) @ self.flat.T

    def _slip_residual(self, x: np.ndarray) -> np.ndarray:
        """Residuals (T - 1, P, 3) in spreads; empty before `find_resting_feet`."""
        return np.diff(x, axis=0) * (self.rest * self.scale)[..., None] if len(self.rest) else np.zeros((0, *x.shape[1:]))


def _robust_height(off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Robust cost and square root of the weight of the residuals (T, P)."""
    limit = np.where(off > 0, LIFTED, SUNK)
    limit[..., off.shape[-1] // 2:] = LIFTED  # a sole tips one way as easily as the other
    return robust(off, limit)


def find_soles(body: Body) -> Pairs:
    """The P outermost points, left and right, of heel and ball of each foot."""
    rest, carrier = body.v_template, np.asarray(body.weights.argmax(1)).ravel()
    joints = body.J_regressor @ rest
    edges = []
    for ankle, foot in (map(body.joint_names.index, names) for names in FEET):
        for part in ((carrier == ankle) & (rest[:, 2] < joints[ankle, 2]), carrier == foot):
            sole = np.flatnonzero(part & (rest[:, 1] < rest[part, 1].min() + SOLE))
            edges += [sole[rest[sole, 0].argmin()], sole[rest[sole, 0].argmax()]]
    one = sparse.csr_matrix((np.ones(len(edges)), (range(len(edges)), edges)), (len(edges), len(rest)))
    return make_pairs(body, one)


def rate_rest(xy: np.ndarray, seen: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Probability (T,) that the whole foot is at rest.

    xy: (T, 2, 2) heel and toes, person's heights; seen: (T, 2) bool; seconds: (T,).
    """
    share = uniform_filter1d(seen.astype(float), WINDOW, axis=0)[..., None]
    smooth = uniform_filter1d(np.where(seen[..., None], xy, 0), WINDOW, axis=0) / np.maximum(share, 1e-6)
    speed = np.linalg.norm(np.gradient(smooth, seconds, axis=0), axis=-1)
    return ((share[..., 0] > 0.99) / (1 + (speed / PACE) ** 4)).min(1)
