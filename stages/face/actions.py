"""From points to facial actions: what the network is known to answer to each action, fitted to what it said.

Points are those of `landmarks.align`: (468, 3) m in the resting face's frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gsac.avatar.artifacts import read_arrays
from gsac.avatar.facemesh import LEFT_EYE, RIGHT_EYE

TABLE = Path(__file__).with_name("actions.npz")
"""Written by `bake.py`."""
BLIND = ("eyeLook", "tongueOut", "cheekPuff", "mouthClose")
"""Actions whose names begin so leave no mark on the points that could tell them from others: they stay at 0."""
AXES = np.array([1.0, 1.0, 0.3])
"""How far the network's x, y and z are trusted."""
ROUNDS, SWEEPS = 40, 6
OWN_VIEW = 2.0
"""mm: how far a person's resting points change with the square of yaw otherwise than the table's, at one radian."""
BROWS_OWN, BROWS_SHARE = 6.0, 0.3
"""How many times as far as others the points may differ that brows move, at least by this share of what all else does: how
high brows sit, and how a picture shows them, is each person's own."""
LARGE_PX, EYES_M = 60.0, 0.063
"""Between the eyes: from here on brows are read as all else; on a smaller face the little that they move is worth less."""


@dataclass(frozen=True)
class Actions:
    """The measured answer of the face network to the open body's head."""

    neutral: np.ndarray  # (468, 3) m, the resting face from the front
    mirror: np.ndarray  # (468,) each point's mirror image
    view: np.ndarray  # (10, 468, 3) mm for each of `view_terms`: what turning the head adds
    modes: np.ndarray  # (K, 468, 3) mm, how else the resting face wavers from view to view, one standard deviation each
    response: np.ndarray  # (E, 468, 3) mm at full action
    names: tuple[str, ...]

    @classmethod
    def load(cls, path: Path = TABLE) -> Actions:
        a = read_arrays(path)
        return cls(a["neutral"].astype(float), a["mirror"].astype(int), a["view"].astype(float),
                   a["modes"].astype(float), a["response"].astype(float), tuple(str(n) for n in a["names"]))

    def own(self) -> np.ndarray:
        """(1404,) how far each coordinate of a person's resting face may differ, as a factor."""
        reach, brows = np.linalg.norm(self.response, axis=2), np.array([name.startswith("brow") for name in self.names])
        return np.where(reach[brows].max(0) > BROWS_SHARE * reach[~brows].max(0), BROWS_OWN, 1.0).repeat(3)

    def pairs(self) -> list[tuple[int, int]]:
        """Indices of left and right actions."""
        return [(i, self.names.index(n[:-4] + "Right")) for i, n in enumerate(self.names)
                if n.endswith("Left") and n[:-4] + "Right" in self.names]


def view_terms(direction: np.ndarray) -> np.ndarray:
    """direction: (..., 3), where the face looks, y up, z toward the camera. Returns (..., 10): the polynomial in yaw and
    pitch (radians) along which the network's resting face changes; 0 for the frontal view."""
    y, p = np.arctan2(direction[..., 0], direction[..., 2]), np.arcsin(np.clip(direction[..., 1], -1, 1))
    return np.stack([y, p, y * y, y * p, p * p, y**3, y * y * p, y * p * p, p**3, y**4], axis=-1)


def solve(points: np.ndarray, weight: np.ndarray, direction: np.ndarray, size: np.ndarray, actions: Actions, ridge: float,
          sparsity: float, symmetry: float, noise: float, identity: float) -> tuple[np.ndarray, np.ndarray]:
    """points: (T, 468, 3) m aligned; weight: (T, 468); direction: (T, 3), where the face looks; size: (T,) px between the eyes.

    Returns coefficients c (T, E) in 0..1 and the person's own resting offset (468, 3) m. Minimises over c, wavering n
    (T, K), offset and what of it changes with the view, residuals in mm: their weighted mean square + ridge |c|^2
    + sparsity sum(c) + symmetry |c_left - c_right|^2 + noise |n|^2 a frame, + |offset|^2 / identity^2 a point once (brows' points
    may differ further); of brows the first two grow as a face gets smaller. The problem is convex; n is eliminated, and
    coordinate descent on c alternates with the closed form for the offset, which is carried on by Nesterov's momentum: an action
    that lasts and the person's own rest look alike, and plain alternation ends with brows raised for good. What n has in all
    frames is the person's too and is returned with the offset.
    """
    T, E = len(points), len(actions.names)
    said = ((points - actions.neutral) * 1e3).reshape(T, -1) - view_terms(direction) @ actions.view.reshape(10, -1)
    response, modes = actions.response.reshape(E, -1), actions.modes.reshape(len(actions.modes), -1)
    w = (weight[..., None] * AXES).reshape(T, -1)
    w = w / np.maximum(w.sum(axis=1, keepdims=True), 1e-9)
    both = np.concatenate([response, modes])
    hessian = (w @ (both[:, None] * both).reshape(-1, w.shape[1]).T).reshape(T, len(both), len(both))
    cc, cn, nn = hessian[:, :E, :E], hessian[:, :E, E:], hessian[:, E:, E:] + noise * np.eye(len(modes))
    doubt = np.where([name.startswith("brow") for name in actions.names], np.maximum(LARGE_PX / size, 1)[:, None] ** 2, 1)
    cc = cc + ridge * doubt[:, :, None] * np.eye(E)
    for left, right in actions.pairs():
        cc[:, [left, right], [left, right]] += symmetry
        cc[:, [left, right], [right, left]] -= symmetry
    schur = cc - cn @ np.linalg.solve(nn, cn.transpose(0, 2, 1))
    free = [k for k, name in enumerate(actions.names) if not name.startswith(BLIND)]

    rest = Rest(w, direction, identity * actions.own())
    c, offset = np.zeros((T, E)), np.zeros_like(said)
    before = offset
    for turn in range(ROUNDS):
        pull = (w * (said - offset)) @ both.T
        toward_n = np.linalg.solve(nn, pull[:, E:, None])[..., 0]
        toward_c = pull[:, :E] - sparsity / 2 * doubt - np.einsum("tek,tk->te", cn, toward_n)
        for _ in range(SWEEPS):
            for k in free:
                step = (toward_c[:, k] - np.einsum("te,te->t", schur[:, k], c)) / schur[:, k, k]
                c[:, k] = np.clip(c[:, k] + step, 0, 1)
        n = np.linalg.solve(nn, (pull[:, E:] - np.einsum("tek,te->tk", cn, c))[..., None])[..., 0]
        found, always = rest.of(said - c @ response - n @ modes)
        offset, before = found + turn / (turn + 3) * (found - before), found
    return c, (always + n.mean(axis=0) @ modes).reshape(-1, 3) / 1e3


class Rest:
    """A person's resting points against the table's: an offset, and a share of it that goes with the square of yaw."""

    def __init__(self, w: np.ndarray, direction: np.ndarray, identity: np.ndarray):
        """w: (T, D) weights that sum to one a frame; direction: (T, 3); identity: (D,) mm, spread of the offset."""
        square = view_terms(direction)[:, 2]
        self.w, self.basis = w, np.stack([np.ones_like(square), square - square.mean()], 1)
        doubt = np.stack([identity**-2, np.full_like(identity, OWN_VIEW**-2)], 1) / w.shape[1]
        self.normal = np.einsum("td,ta,tb->dab", w, self.basis, self.basis) + doubt[:, :, None] * np.eye(2)

    def of(self, left_over: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """left_over: (T, D) mm. Returns the likeliest offset of each frame (T, D), and what all have (D,)."""
        pull = np.einsum("td,ta->da", self.w * left_over, self.basis)
        both = np.linalg.solve(self.normal, pull[..., None])[..., 0]
        return self.basis @ both.T, both[:, 0]


def between_eyes(points: np.ndarray, neutral: np.ndarray) -> np.ndarray:
    """points: (T, 468, 3) px; neutral: (468, 3) m. (T,) px between the eyes of a face of usual size, however it is turned."""
    wide = np.linalg.norm(points[:, LEFT_EYE] - points[:, RIGHT_EYE], axis=-1)
    return EYES_M * wide / np.linalg.norm(neutral[LEFT_EYE] - neutral[RIGHT_EYE])


def smooth(c: np.ndarray, times: np.ndarray, sigma: float) -> np.ndarray:
    """c: (T, E) at rising times (T,) s. The Gaussian mean over time with this standard deviation in seconds."""
    out = np.empty_like(c)
    first, last = np.searchsorted(times, times - 4 * sigma), np.searchsorted(times, times + 4 * sigma, side="right")
    for t, (a, b) in enumerate(zip(first, last, strict=True)):
        near = np.exp(-0.5 * ((times[a:b] - times[t]) / sigma) ** 2)
        out[t] = near @ c[a:b] / near.sum()
    return out


def fill(c: np.ndarray, valid: np.ndarray, times: np.ndarray | None, rest_time: float) -> np.ndarray:
    """c: (V, E) of the valid frames; valid: (T,). Returns (T, E): frames between fall back to rest, by 1/e each
    `rest_time` s from the nearest valid frame; at once where there is no time (photos)."""
    out = np.zeros((len(valid), c.shape[1]))
    out[valid] = c
    if times is None or not valid.any():
        return out
    seen = times[valid]
    for t in np.flatnonzero(~valid):
        nearest = int(np.argmin(np.abs(seen - times[t])))
        out[t] = c[nearest] * np.exp(-abs(seen[nearest] - times[t]) / rest_time)
    return out
