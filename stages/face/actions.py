"""From points to facial actions: what the network is known to answer to each action, fitted to what it said.

Points are those of `landmarks.align`: (468, 3) m in the resting face's frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gsac.avatar.artifacts import read_arrays

TABLE = Path(__file__).with_name("actions.npz")
"""Written by `bake.py`."""
BLIND = ("eyeLook", "tongueOut", "cheekPuff", "mouthClose")
"""Actions whose names begin so leave no mark on the points that could tell them from others: they stay at 0."""
AXES = np.array([1.0, 1.0, 0.3])
"""How far the network's x, y and z are trusted."""
ROUNDS, SWEEPS = 30, 6


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

    def pairs(self) -> list[tuple[int, int]]:
        """Indices of left and right actions."""
        return [(i, self.names.index(n[:-4] + "Right")) for i, n in enumerate(self.names)
                if n.endswith("Left") and n[:-4] + "Right" in self.names]


def view_terms(direction: np.ndarray) -> np.ndarray:
    """direction: (..., 3), where the face looks, y up, z toward the camera. Returns (..., 10): the polynomial in yaw and
    pitch (radians) along which the network's resting face changes; 0 for the frontal view."""
    y, p = np.arctan2(direction[..., 0], direction[..., 2]), np.arcsin(np.clip(direction[..., 1], -1, 1))
    return np.stack([y, p, y * y, y * p, p * p, y**3, y * y * p, y * p * p, p**3, y**4], axis=-1)


def solve(points: np.ndarray, weight: np.ndarray, direction: np.ndarray, actions: Actions, ridge: float,
          sparsity: float, symmetry: float, noise: float, identity: float) -> tuple[np.ndarray, np.ndarray]:
    """points: (T, 468, 3) m aligned; weight: (T, 468); direction: (T, 3), where the face looks.

    Returns coefficients c (T, E) in 0..1 and the person's own resting offset (468, 3) m. Minimises over c, wavering n
    (T, K) and offset, residuals in mm: their weighted mean square + ridge |c|^2 + sparsity sum(c)
    + symmetry |c_left - c_right|^2 + noise |n|^2 a frame, + |offset|^2 / identity^2 a point once. The problem is convex;
    n is eliminated, and coordinate descent on c alternates with the closed form for the offset. What n has in all frames
    is the person's too and is returned with the offset.
    """
    T, E = len(points), len(actions.names)
    said = ((points - actions.neutral) * 1e3).reshape(T, -1) - view_terms(direction) @ actions.view.reshape(10, -1)
    response, modes = actions.response.reshape(E, -1), actions.modes.reshape(len(actions.modes), -1)
    w = (weight[..., None] * AXES).reshape(T, -1)
    w = w / np.maximum(w.sum(axis=1, keepdims=True), 1e-9)
    both = np.concatenate([response, modes])
    hessian = (w @ (both[:, None] * both).reshape(-1, w.shape[1]).T).reshape(T, len(both), len(both))
    cc, cn, nn = hessian[:, :E, :E], hessian[:, :E, E:], hessian[:, E:, E:] + noise * np.eye(len(modes))
    cc = cc + ridge * np.eye(E)
    for left, right in actions.pairs():
        cc[:, [left, right], [left, right]] += symmetry
        cc[:, [left, right], [right, left]] -= symmetry
    schur = cc - cn @ np.linalg.solve(nn, cn.transpose(0, 2, 1))
    free = [k for k, name in enumerate(actions.names) if not name.startswith(BLIND)]

    c, offset = np.zeros((T, E)), np.zeros(said.shape[1])
    for _ in range(ROUNDS):
        pull = (w * (said - offset)) @ both.T
        toward_n = np.linalg.solve(nn, pull[:, E:, None])[..., 0]
        toward_c = pull[:, :E] - sparsity / 2 - np.einsum("tek,tk->te", cn, toward_n)
        for _ in range(SWEEPS):
            for k in free:
                step = (toward_c[:, k] - np.einsum("te,te->t", schur[:, k], c)) / schur[:, k, k]
                c[:, k] = np.clip(c[:, k] + step, 0, 1)
        n = np.linalg.solve(nn, (pull[:, E:] - np.einsum("tek,te->tk", cn, c))[..., None])[..., 0]
        left_over = said - c @ response - n @ modes
        offset = (w * left_over).sum(axis=0) / (w.sum(axis=0) + 1 / (identity**2 * said.shape[1]))
    return c, (offset + n.mean(axis=0) @ modes).reshape(-1, 3) / 1e3


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
