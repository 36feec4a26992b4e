"""Fits facial actions to the face network's points, by the network's measured response to each action.

Points are those of `landmarks.align`: (468, 3) m in the resting face's frame. Channels are linear combinations of their coordinates
in which the network's noise is white.
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
"""Beginnings of the names of actions that the points cannot tell from others: they stay at 0."""
COMMON = ("jawOpen", "eyeBlink", "mouthSmile", "brow", "cheekSquint", "mouthPucker", "mouthFunnel")
"""Beginnings of the names of the actions that faces use most."""
USUAL, SELDOM, NEVER = 0.4, 0.15, 1e-3
"""Prior standard deviation of the actions that faces use most, of others, and of those that the points cannot tell."""
BROWS = 0.2
"""Prior standard deviation of the brow actions in one frame: most of what a frame shows is noise."""
RESTING_BROWS = 0.5
"""Prior standard deviation of a person's resting brows from the average, in full actions, the same from every side. Without it a
person with low brows seems to frown all the time: the rest, as measured on heads of one make, does not change with yaw as a frown
does."""
FRESH = 0.3
"""Share of a nearby frame's brow evidence that is new: errors in one person's frames are correlated."""
BOTH_SIDES, BROWS_TOGETHER = 0.9, 0.8
"""Correlation of the left and right of an action, and of inner and outer brows."""
SLOW = ("mouthSmile", "cheekSquint", "mouthFrown", "noseSneer")
"""Beginnings of the names of actions that are slow, as brows are; a talking mouth is faster, lids are fastest."""
ROUNDS, SWEEPS, LAST_SWEEPS = 12, 4, 30
"""Rounds of the alternation in `solve`, sweeps of coordinate descent in each, and sweeps for the brows at the end."""


@dataclass(frozen=True)
class Actions:
    """The measured response of the face network to people's faces."""

    neutral: np.ndarray  # (468, 3) m, the average resting face from the front
    mirror: np.ndarray  # (468,) each point's mirror image
    view: np.ndarray  # (10, 468, 3) mm for each of `view_terms`: what turning the head adds
    response: np.ndarray  # (3, E, 468, 3) mm at full action, for each of `yaw_terms`
    channels: np.ndarray  # (C, 468, 3) 1/mm, combinations of coordinates in which the network's noise is white with deviation 1
    persons: np.ndarray  # (3, C, C) covariance in the channels of people's resting faces, for each of `yaw_terms`
    own: np.ndarray  # (468, 3) mm, standard deviation of the same at each point
    wavering: np.ndarray  # (468, 3) mm, standard deviation of the network's noise from frame to frame
    corner: np.ndarray  # (468, 3) the open body's vertices of the face on which each point lies
    share: np.ndarray  # (468, 3) its barycentric coordinates there
    names: tuple[str, ...]

    @classmethod
    def load(cls, path: Path = TABLE) -> Actions:
        a = read_arrays(path)
        as_is = {name: a[name].astype(float) for name in ("neutral", "view", "response", "channels", "persons", "own", "wavering",
                                                          "share")}
        return cls(mirror=a["mirror"].astype(int), corner=a["corner"].astype(int), names=tuple(str(n) for n in a["names"]), **as_is)

    @cached_property
    def in_channels(self) -> tuple[np.ndarray, np.ndarray]:
        """`view` (10, C) and `response` (3, E, C), in the channels."""
        return tuple(np.tensordot(a, self.channels, ([-2, -1], [1, 2])) for a in (self.view, self.response))


def view_terms(direction: np.ndarray) -> np.ndarray:
    """direction: (..., 3), where the face looks, y up, z toward the camera. Returns (..., 10): polynomial terms in yaw and pitch,
    rad, with which the network's resting face changes; 0 from the front."""
    y, p = _yaw(direction), np.arcsin(np.clip(direction[..., 1], -1, 1))
    return np.stack([y, p, y * y, y * p, p * p, y**3, y * y * p, y * p * p, p**3, y**4], axis=-1)


def yaw_terms(direction: np.ndarray) -> np.ndarray:
    """direction: (..., 3), where the face looks. Returns (..., 3): 1, yaw and its square, the weights of `Actions.response` and of
    the person's rest."""
    y = _yaw(direction)
    return np.stack([np.ones_like(y), y, y * y], axis=-1)


def _yaw(direction: np.ndarray) -> np.ndarray:
    """(...) rad, 0 from the front."""
    return np.arctan2(direction[..., 0], direction[..., 2])


def prior_sigma(names: tuple[str, ...]) -> np.ndarray:
    """(E,) prior standard deviation of each action about 0, brows as the others."""
    return np.array([NEVER if n.startswith(BLIND) else USUAL if n.startswith(COMMON) else SELDOM for n in names])


def prior_covariance(names: tuple[str, ...]) -> np.ndarray:
    """(E, E) of the actions about 0."""
    alike, spread = np.eye(len(names)), np.where([name.startswith("brow") for name in names], BROWS, prior_sigma(names))
    for i, a in enumerate(names):
        for k, b in enumerate(names):
            if a != b and a.replace("Left", "Right") == b.replace("Left", "Right"):
                alike[i, k] = BOTH_SIDES
            elif "browInnerUp" in (a, b) and "browOuterUp" in a + b:
                alike[i, k] = BROWS_TOGETHER
    return alike * spread * spread[:, None]


def rest_covariance(actions: Actions) -> np.ndarray:
    """(3C, 3C) prior covariance, in the channels, of a person's resting face about the average, for each of `yaw_terms`."""
    _, response = actions.in_channels
    C = response.shape[-1]
    out = np.zeros((3 * C, 3 * C))
    for k, covariance in enumerate(actions.persons):
        out[k * C: (k + 1) * C, k * C: (k + 1) * C] = covariance
    brows = response[:, [name.startswith("brow") for name in actions.names]].swapaxes(0, 1).reshape(-1, 3 * C)
    return out + RESTING_BROWS**2 * brows.T @ brows


def solve(points: np.ndarray, direction: np.ndarray, actions: Actions, sparsity: float, doubt: float,
          times: np.ndarray | None = None, pause: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """points: (T, 468, 3) m aligned; direction: (T, 3), where the face looks; times: (T,) s, or None for photos.

    Returns coefficients c (T, E) in 0..1 and the person's resting points less the average ones (468, 3) m. In the channels it
    minimises over c and the person's rest o: |seen - o - c response|^2 / doubt^2 + c' prior_covariance^-1 c + 2 sparsity sum(c) in
    each frame, and o' rest_covariance^-1 o once; o changes with yaw. The problem is convex: coordinate descent on c alternates with
    the closed form for o under Nesterov's momentum. A lasting action resembles the person's rest, and plain alternation stops too
    early, with the brows raised throughout. With times, each frame's brows are then found again from all frames near it, weighted
    by a Gaussian of standard deviation `pause` s.
    """
    T, E = len(points), len(actions.names)
    away = (points - actions.neutral) * 1e3
    view, response = actions.in_channels
    seen = np.tensordot(away, actions.channels, ([1, 2], [1, 2])) - view_terms(direction) @ view
    answer = np.tensordot(yaw_terms(direction), response, 1) / doubt
    seen = seen / doubt
    prior = np.linalg.inv(prior_covariance(actions.names))
    strength = answer @ answer.transpose(0, 2, 1)
    terms, C = yaw_terms(direction), seen.shape[1]
    share = np.linalg.inv(np.kron(terms.T @ terms, np.eye(C)) + np.linalg.inv(rest_covariance(actions)) * doubt**2)
    free = [k for k, name in enumerate(actions.names) if not name.startswith(BLIND)]
    c, rest = np.zeros((T, E)), np.zeros_like(seen)
    before = rest
    for turn in range(ROUNDS):
        descend(c, np.einsum("tec,tc->te", answer, seen - rest) - sparsity, strength + prior, free, SWEEPS)
        left = seen - np.einsum("te,tec->tc", c, answer)
        found = terms @ (share @ (terms.T @ left).ravel()).reshape(-1, C)
        rest, before = found + turn / (turn + 3) * (found - before), found
    if times is not None and pause > 0:
        brows = [k for k in free if actions.names[k].startswith("brow")]
        near = np.exp(-0.5 * ((times[:, None] - times) / pause) ** 2)
        count = near.sum(axis=1, keepdims=True)
        near *= (1 + FRESH * (count - 1)) / count
        left = seen - rest - np.einsum("te,tec->tc", np.delete(c, brows, 1), np.delete(answer, brows, 1))
        pull = near @ np.einsum("tec,tc->te", answer[:, brows], left) - sparsity
        among = np.ix_(range(T), brows, brows)
        c[:, brows] = descend(c[:, brows], pull, np.tensordot(near, strength[among], 1) + prior[np.ix_(brows, brows)],
                              range(len(brows)), LAST_SWEEPS)
    return c, estimate_rest(away, direction, c, actions)


def descend(c: np.ndarray, pull: np.ndarray, hessian: np.ndarray, columns: Iterable[int], sweeps: int) -> np.ndarray:
    """c: (T, E), changed in place; pull: (T, E); hessian: (T, E, E). Coordinate descent over columns on c' hessian c / 2 - pull c
    with c in 0..1, each frame for itself; returns c (T, E)."""
    for _ in range(sweeps):
        for k in columns:
            step = (pull[:, k] - np.einsum("te,te->t", hessian[:, k], c)) / hessian[:, k, k]
            c[:, k] = np.clip(c[:, k] + step, 0, 1)
    return c


def estimate_rest(away: np.ndarray, direction: np.ndarray, c: np.ndarray, actions: Actions) -> np.ndarray:
    """away: (T, 468, 3) mm from the neutral face; direction: (T, 3); c: (T, E).

    Returns (468, 3) m: the mean over the frames of what neither view nor actions explain, shrunk by its prior.
    """
    shown = (yaw_terms(direction)[:, :, None] * c[:, None]).reshape(len(c), -1)
    explained = shown @ actions.response.reshape(shown.shape[1], -1) + view_terms(direction) @ actions.view.reshape(10, -1)
    left = (away.reshape(len(c), -1) - explained).mean(axis=0).reshape(-1, 3)
    return left * actions.own**2 / (actions.own**2 + actions.wavering**2 / len(c)) / 1e3


def smoothing_sigma(names: tuple[str, ...], lids: float, mouth: float, slow: float, apart: float = 0.0) -> np.ndarray:
    """(E,) s, the smoothing of each action: `mouth` and `slow`, where above 0, are at least the time `apart` between frames; `lids`
    are not, as a blink may last one frame. Brows get 0: `solve` smooths them."""
    mouth, slow = (max(sigma, apart) if sigma > 0 else 0.0 for sigma in (mouth, slow))
    return np.select([[name.startswith(which) for name in names] for which in (SLOW, "brow", "eye")], [slow, 0.0, lids], mouth)


def smooth(c: np.ndarray, times: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """c: (T, E); times: (T,) s, rising; sigma: (E,) s. Returns (T, E): the mean over time, weighted by Gaussians of sigma."""
    out = c.copy()
    for one in np.unique(sigma[sigma > 0]):
        same = sigma == one
        first, last = np.searchsorted(times, times - 4 * one), np.searchsorted(times, times + 4 * one, side="right")
        for t, (a, b) in enumerate(zip(first, last, strict=True)):
            near = np.exp(-0.5 * ((times[a:b] - times[t]) / one) ** 2)
            out[t, same] = near @ c[a:b, same] / near.sum()
    return out


def fill_unseen(c: np.ndarray, valid: np.ndarray, times: np.ndarray | None, rest_time: float) -> np.ndarray:
    """c: (V, E) of the valid frames; valid: (T,) bool; times: (T,) s, or None for photos.

    Returns (T, E): the others fall back to rest by a factor e each `rest_time` s from the nearest valid frame; in photos at once.
    """
    out = np.zeros((len(valid), c.shape[1]))
    out[valid] = c
    if times is None or not valid.any():
        return out
    seen = times[valid]
    for t in np.flatnonzero(~valid):
        nearest = int(np.argmin(np.abs(seen - times[t])))
        out[t] = c[nearest] * np.exp(-abs(seen[nearest] - times[t]) / rest_time)
    return out
