"""Feet on the ground: soles lie flat on one plane through the clip, or above it, and one that rests in the picture stays in place.

The plane is level with the clip's upright (stance.py); its height is an unknown of the clip. Who lifts a foot is let go.
T frames, P = 8 points of the soles (inner and outer edge of heel and ball of each foot), n unknowns a frame, S shape unknowns,
H of the stance.
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
"""Metres that a sole on the ground is off the plane: shoes, bare soles that roll."""
TILT = 0.004
"""Metres that one edge of it is higher than the other: three degrees."""
LIFTED, SUNK = 2.0, 4.0
"""Spreads above the ground, and below it, from which a foot counts less and less: it may be lifted, and the camera may be moved."""
SOLE = 0.008
"""Metres above a foot's lowest point up to which it is sole."""
SLIDE = 0.03
"""m/s that a foot at rest moves."""
SLIPPED = 3.0
"""Spreads of that from which it counts less and less."""
PACE = 0.04
"""Person's heights a second, in the picture, at which heel and toes are half believed to rest; who steps is faster."""
WINDOW = 3
"""Frames over which the detector's trembling is averaged."""


class Ground:
    """The terms of one clip."""

    def __init__(self, body: Body, weight: float = 1.0):
        """weight: of both terms."""
        self.pairs = find_soles(body)
        self.scale = np.sqrt(weight)
        half = np.eye(self.pairs.count // 2)
        self.flat = np.concatenate([np.kron(half, [[0.5, 0.5]]) / OFF, np.kron(half, [[1, -1]]) / TILT]) * self.scale
        """(P, P) from the points' heights to middles above the plane and edges above each other, in spreads."""
        self.rest = np.zeros((0, self.pairs.count))  # (T - 1, P) square root of the information, s/m

    def find_resting_feet(self, xy: np.ndarray, seen: np.ndarray, seconds: np.ndarray | None, height: float) -> None:
        """xy: (T, 133, 2) px; seen: (T, 133); height: px, of the person. Learns which feet rest; without times none do."""
        if seconds is None or len(xy) < WINDOW:
            return
        feet = np.stack([rate_rest(xy[:, points] / height, seen[:, points], seconds) for points in SEEN], 1)  # (T, 2)
        both = np.repeat(np.minimum(feet[:-1], feet[1:]), 4, axis=1) / 2  # two edges share what is known of a sole
        self.rest = np.sqrt(both) / SLIDE / np.diff(seconds)[:, None]

    def estimate_level(self, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray) -> np.ndarray:
        """(1,) m: where the plane begins, so that most lower soles touch it."""
        return np.median(self._heights(chain, shape, transl, stance).min(1))[None]

    def cost(self, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray, level: np.ndarray) -> float:
        x = place_points(chain, self.pairs, shape) + transl[:, None]
        off, slip = self._off(x, stance, level), self._slip(x)
        return float(_off_ground(off)[0].sum() + robust(slip, SLIPPED)[0].sum())

    def add(self, system: System, skeleton: Skeleton, chain: Chain, shape: np.ndarray, transl: np.ndarray, stance: np.ndarray,
            level: np.ndarray) -> None:
        """Adds both terms to the normal equations; shared unknowns are focal, shape, stance, level."""
        x = place_points(chain, self.pairs, shape) + transl[:, None]
        n, first = system.gradient.shape[1], 1 + len(shape)
        up, by_slope = upright(stance)
        off = self._off(x, stance, level)
        shrink = _off_ground(off)[1]
        rows = pull_back(skeleton, chain, self.pairs, shape, np.broadcast_to(up, (*x.shape[:2], 1, 3)))[:, :, 0]
        jacobian = np.zeros((*x.shape[:2], n + first + len(stance) + 1))
        jacobian[..., :n], jacobian[..., n + 1: n + 1 + rows.shape[2] - n] = rows[..., :n], rows[..., n:]
        jacobian[..., -3:-1], jacobian[..., -1] = x @ by_slope, -1
        system.add(slice(None), self.flat @ jacobian * shrink[..., None], off * shrink)
        if self.rest.any():
            axes = np.broadcast_to(np.eye(3), (*x.shape[:2], 3, 3))
            self._add_slip(system, pull_back(skeleton, chain, self.pairs, shape, axes), x)

    def _add_slip(self, system: System, rows: np.ndarray, x: np.ndarray) -> None:
        """rows: (T, P, 3, n + S') of the soles' places x (T, P, 3)."""
        slip = self._slip(x)
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
        return (place_points(chain, self.pairs, shape) + transl[:, None]) @ upright(stance)[0]

    def _off(self, x: np.ndarray, stance: np.ndarray, level: np.ndarray) -> np.ndarray:
        """(T, P) middles above the plane, edges above each other, in spreads."""
        return (x @ upright(stance)[0] - level[0]) @ self.flat.T

    def _slip(self, x: np.ndarray) -> np.ndarray:
        """(T - 1, P, 3) in spreads; empty where nothing rests."""
        return np.diff(x, axis=0) * (self.rest * self.scale)[..., None] if len(self.rest) else np.zeros((0, *x.shape[1:]))


def _off_ground(off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    limit = np.where(off > 0, LIFTED, SUNK)
    limit[..., off.shape[-1] // 2:] = LIFTED  # a sole tips one way as easily as the other
    return robust(off, limit)


def find_soles(body: Body) -> Pairs:
    """The outermost points, right and left, of heel and ball of each foot."""
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
    """xy: (T, 2, 2) heel and toes, heights; seen: (T, 2). Returns (T,) in 0..1: how surely the whole foot is at rest."""
    share = uniform_filter1d(seen.astype(float), WINDOW, axis=0)[..., None]
    smooth = uniform_filter1d(np.where(seen[..., None], xy, 0), WINDOW, axis=0) / np.maximum(share, 1e-6)
    speed = np.linalg.norm(np.gradient(smooth, seconds, axis=0), axis=-1)
    return ((share[..., 0] > 0.99) / (1 + (speed / PACE) ** 4)).min(1)
