"""From points to facial actions: what the network is known to answer to each action, fitted to what it said.

Points are those of `landmarks.align`: (468, 3) m in the resting face's frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import read_arrays

TABLE = Path(__file__).with_name("actions.npz")
"""Written by `tools/face_actions.py`."""
BLIND = ("eyeLook", "tongueOut", "cheekPuff", "mouthClose")
"""Actions whose names begin so leave no mark on the points that could tell them from others: they stay at 0."""
COMMON = ("jawOpen", "eyeBlink", "mouthSmile", "brow", "cheekSquint", "mouthPucker", "mouthFunnel")
USUAL, SELDOM, NEVER = 0.4, 0.15, 1e-3
"""Spread of the actions that faces use most, of others, and of those that nothing tells."""
BROWS = 0.2
"""Spread that one look's word about brows is taken with: what it says of them is mostly not so."""
RESTING_BROWS = 0.5
"""How far people's brows at rest lie from everybody's, in full actions and from every side alike. Without it a person with low
brows frowns for good: the rest, as measured on heads of one make, does not change with yaw as a frown does."""
FRESH = 0.3
"""Share of what another look near in time says of brows that is news: looks of one person are wrong alike."""
BOTH_SIDES, BROWS_TOGETHER = 0.9, 0.8
"""How alike left and right, and inner and outer brows, rise."""
SLOW = ("mouthSmile", "cheekSquint", "mouthFrown", "noseSneer")
"""Actions that take their time, as brows do: the talking mouth does not, and lids least of all."""
ROUNDS, SWEEPS, LAST_SWEEPS = 12, 4, 30


@dataclass(frozen=True)
class Actions:
    """The measured answer of the face network to people's faces."""

    neutral: np.ndarray  # (468, 3) m, everybody's resting face from the front
    mirror: np.ndarray  # (468,) each point's mirror image
    view: np.ndarray  # (10, 468, 3) mm for each of `view_terms`: what turning the head adds
    response: np.ndarray  # (3, E, 468, 3) mm at full action, for each of `turns`
    channels: np.ndarray  # (C, 468, 3) 1/mm, sums of coordinates in which the network's wavering is white, of spread one
    persons: np.ndarray  # (3, C, C) covariance there of how a person's resting face differs from everybody's, for each of `turns`
    own: np.ndarray  # (468, 3) mm, spread of the same at each point
    wavering: np.ndarray  # (468, 3) mm, spread of what else the network says from look to look
    corner: np.ndarray  # (468, 3) the open body's vertices among which each point lies
    share: np.ndarray  # (468, 3) and how near to each
    names: tuple[str, ...]

    @classmethod
    def load(cls, path: Path = TABLE) -> Actions:
        a = read_arrays(path)
        as_is = {name: a[name].astype(float) for name in ("neutral", "view", "response", "channels", "persons", "own", "wavering",
                                                          "share")}
        return cls(mirror=a["mirror"].astype(int), corner=a["corner"].astype(int), names=tuple(str(n) for n in a["names"]), **as_is)

    @cached_property
    def heard(self) -> tuple[np.ndarray, np.ndarray]:
        """`view` (10, C) and `response` (3, E, C) in the channels."""
        return tuple(np.tensordot(a, self.channels, ([-2, -1], [1, 2])) for a in (self.view, self.response))


def view_terms(direction: np.ndarray) -> np.ndarray:
    """direction: (..., 3), where the face looks, y up, z toward the camera. Returns (..., 10): the polynomial in yaw and
    pitch (radians) along which the network's resting face changes; 0 for the frontal view."""
    y, p = yaw_of(direction), np.arcsin(np.clip(direction[..., 1], -1, 1))
    return np.stack([y, p, y * y, y * p, p * p, y**3, y * y * p, y * p * p, p**3, y**4], axis=-1)


def turns(direction: np.ndarray) -> np.ndarray:
    """direction: (..., 3). Returns (..., 3): how much of each of `Actions.response`, and of its own rest, a face that looks there
    shows."""
    y = yaw_of(direction)
    return np.stack([np.ones_like(y), y, y * y], axis=-1)


def yaw_of(direction: np.ndarray) -> np.ndarray:
    return np.arctan2(direction[..., 0], direction[..., 2])


def spread_of(names: tuple[str, ...]) -> np.ndarray:
    """(E,) how far from 0 each action usually goes."""
    return np.array([NEVER if n.startswith(BLIND) else USUAL if n.startswith(COMMON) else SELDOM for n in names])


def togetherness(names: tuple[str, ...]) -> np.ndarray:
    """(E, E) covariance of the actions about 0."""
    alike, spread = np.eye(len(names)), np.where([name.startswith("brow") for name in names], BROWS, spread_of(names))
    for i, a in enumerate(names):
        for k, b in enumerate(names):
            if a != b and a.replace("Left", "Right") == b.replace("Left", "Right"):
                alike[i, k] = BOTH_SIDES
            elif "browInnerUp" in (a, b) and "browOuterUp" in a + b:
                alike[i, k] = BROWS_TOGETHER
    return alike * spread * spread[:, None]


def persons_rest(actions: Actions) -> np.ndarray:
    """(3C, 3C) covariance of how a person's resting face differs from everybody's in the channels, for each of `turns`."""
    _, response = actions.heard
    C = response.shape[-1]
    out = np.zeros((3 * C, 3 * C))
    for k, covariance in enumerate(actions.persons):
        out[k * C: (k + 1) * C, k * C: (k + 1) * C] = covariance
    brows = response[:, [name.startswith("brow") for name in actions.names]].swapaxes(0, 1).reshape(-1, 3 * C)
    return out + RESTING_BROWS**2 * brows.T @ brows


def solve(points: np.ndarray, direction: np.ndarray, actions: Actions, sparsity: float, doubt: float,
          times: np.ndarray | None = None, pause: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """points: (T, 468, 3) m aligned; direction: (T, 3), where the face looks; times: (T,) s, or None where there are none.

    Returns coefficients c (T, E) in 0..1 and how the person's own resting points differ from everybody's (468, 3) m. Minimises over
    c and the person's rest o in the channels, where the network's wavering is white: |said - o - c response|^2 / doubt^2
    + c' togetherness^-1 c + 2 sparsity sum(c) a frame, + o' persons_rest^-1 o once; o changes with yaw. The problem is convex;
    coordinate descent on c alternates with the closed form for o, which is carried on by Nesterov's momentum: an action that lasts
    and the person's own rest look alike, and plain alternation ends with brows raised for good.
    With times, each frame's brows are then found again from all looks near it, by a Gaussian of standard deviation `pause` s.
    """
    T, E = len(points), len(actions.names)
    away = (points - actions.neutral) * 1e3
    view, response = actions.heard
    said = np.tensordot(away, actions.channels, ([1, 2], [1, 2])) - view_terms(direction) @ view
    answer = np.tensordot(turns(direction), response, 1) / doubt
    said = said / doubt
    prior = np.linalg.inv(togetherness(actions.names))
    loudness = answer @ answer.transpose(0, 2, 1)
    terms, C = turns(direction), said.shape[1]
    share = np.linalg.inv(np.kron(terms.T @ terms, np.eye(C)) + np.linalg.inv(persons_rest(actions)) * doubt**2)
    free = [k for k, name in enumerate(actions.names) if not name.startswith(BLIND)]
    c, rest = np.zeros((T, E)), np.zeros_like(said)
    before = rest
    for turn in range(ROUNDS):
        descend(c, np.einsum("tec,tc->te", answer, said - rest) - sparsity, loudness + prior, free, SWEEPS)
        left = said - np.einsum("te,tec->tc", c, answer)
        found = terms @ (share @ (terms.T @ left).ravel()).reshape(-1, C)
        rest, before = found + turn / (turn + 3) * (found - before), found
    if times is not None and pause > 0:
        brows = [k for k in free if actions.names[k].startswith("brow")]
        near = np.exp(-0.5 * ((times[:, None] - times) / pause) ** 2)
        looks = near.sum(axis=1, keepdims=True)
        near *= (1 + FRESH * (looks - 1)) / looks
        left = said - rest - np.einsum("te,tec->tc", np.delete(c, brows, 1), np.delete(answer, brows, 1))
        pull = near @ np.einsum("tec,tc->te", answer[:, brows], left) - sparsity
        among = np.ix_(range(T), brows, brows)
        c[:, brows] = descend(c[:, brows], pull, np.tensordot(near, loudness[among], 1) + prior[np.ix_(brows, brows)],
                              range(len(brows)), LAST_SWEEPS)
    return c, own_rest(away, direction, c, actions)


def descend(c: np.ndarray, pull: np.ndarray, hessian: np.ndarray, columns: Iterable[int], sweeps: int) -> np.ndarray:
    """c: (T, E), changed in place; pull: (T, E); hessian: (T, E, E). Sweeps over columns toward the least of
    c' hessian c / 2 - pull c with c in 0..1, each frame for itself; returns c."""
    for _ in range(sweeps):
        for k in columns:
            step = (pull[:, k] - np.einsum("te,te->t", hessian[:, k], c)) / hessian[:, k, k]
            c[:, k] = np.clip(c[:, k] + step, 0, 1)
    return c


def own_rest(away: np.ndarray, direction: np.ndarray, c: np.ndarray, actions: Actions) -> np.ndarray:
    """away: (T, 468, 3) mm from the neutral face. (468, 3) m: what neither view nor actions explain, as far as it is believed."""
    shown = (turns(direction)[:, :, None] * c[:, None]).reshape(len(c), -1)
    explained = shown @ actions.response.reshape(shown.shape[1], -1) + view_terms(direction) @ actions.view.reshape(10, -1)
    left = (away.reshape(len(c), -1) - explained).mean(axis=0).reshape(-1, 3)
    return left * actions.own**2 / (actions.own**2 + actions.wavering**2 / len(c)) / 1e3


def pace(names: tuple[str, ...], lids: float, mouth: float, slow: float, apart: float = 0.0) -> np.ndarray:
    """(E,) s, each action's own smoothing; what is smoothed at all by no less than frames are apart, but for lids: a blink may be
    one frame. Brows are calm as they are found."""
    mouth, slow = (max(sigma, apart) if sigma > 0 else 0.0 for sigma in (mouth, slow))
    return np.select([[name.startswith(which) for name in names] for which in (SLOW, "brow", "eye")], [slow, 0.0, lids], mouth)


def smooth(c: np.ndarray, times: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """c: (T, E) at rising times (T,) s; sigma: (E,). The Gaussian mean over time with these standard deviations in seconds."""
    out = c.copy()
    for one in np.unique(sigma[sigma > 0]):
        same = sigma == one
        first, last = np.searchsorted(times, times - 4 * one), np.searchsorted(times, times + 4 * one, side="right")
        for t, (a, b) in enumerate(zip(first, last, strict=True)):
            near = np.exp(-0.5 * ((times[a:b] - times[t]) / one) ** 2)
            out[t, same] = near @ c[a:b, same] / near.sum()
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
