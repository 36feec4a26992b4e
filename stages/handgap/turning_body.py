"""What is known of the turning body around the arms, and a Gaussian process in its frame for a hand's points about the palm.

Seen sideways a point of the body at (x, z) in the body's frame lies at x cos y + z sin y for the turn y, so constant x and z
of spread c have the covariance c^2 cos(y - y'), and x and z that stir in time that times a squared exponential of time.
Up and down the point stays, but for the perspective that lets it sink and rise with the turn. Linear, so in closed form: where
nothing turns an ordinary Gaussian process is left.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from gsac.stages.handgap.body_turn import SEEN_SCORE, body_centre, body_turn, settled
from gsac.stages.handgap.missing_hands import runs

LENGTHS_S = (0.25, 0.4, 0.6, 0.9, 1.4)
"""Grid of the stirring's time constant."""
STIRS = (0.015, 0.03, 0.06, 0.12, 0.24)
"""Grid of its size, torso lengths."""
NOISES = (0.002, 0.004, 0.008, 0.016)
"""Grid of the detector's noise, torso lengths."""
REACH, OFFSET = 0.8, 0.2
"""Torso lengths from the body's axis, and of the middle of the seen torso from that axis."""
TILT, BEND = 0.1, 0.05
"""Torso lengths: perspective's share up and down, and its second harmonic of the turn."""
LIKELY = 4.0
"""Log likelihood below the best of the grid from which on a process has no say."""
BIAS_SHARE = 0.3
"""Of the stirring, what keeps to the image and not to the body: the detector's habits."""
MOST_FRAMES, NEAR_S = 200, 1.5
"""Of a long clip, all seen frames this close to a gap are used, and every n-th of the others."""


@dataclass
class Turner:
    """What is known of the body around the arms."""

    centre: np.ndarray  # (T, 2) px
    turn: np.ndarray  # (T,) rad
    torso: float  # px
    times: np.ndarray  # (T,) s
    shown: np.ndarray  # (T, 133) bool
    spectra: dict = field(default_factory=dict)
    """(axis, seen frames) -> eigenvalues and vectors of each process of the grid; parts of one arm share their frames."""

    def spectrum(self, axis: int, known: np.ndarray) -> list[tuple[float, float, np.ndarray, np.ndarray]]:
        """known: (K,) frames. Returns length s, stir, eigenvalues (K,), vectors (K, K) of each process."""
        key = axis, known.tobytes()
        if key not in self.spectra:
            turn, times = self.turn[known], self.times[known]
            self.spectra[key] = [(length, stir, *np.linalg.eigh(covariance(axis, turn, turn, times, times, length, stir)))
                                 for length, stir in itertools.product(LENGTHS_S, STIRS)]
        return self.spectra[key]


def watch(xy: np.ndarray, score: np.ndarray, world: np.ndarray, times: np.ndarray, torso: np.ndarray) -> Turner:
    """torso: (T,) px, inf where it is not seen."""
    size = float(np.median(torso))
    if not np.isfinite(size):
        seen = xy[score > 0]
        size = max(float(np.ptp(seen, axis=0).max()) / 3, 1.0) if len(seen) else 1.0
    centre = settled(body_centre(xy, score), times, size)
    return Turner(centre, body_turn(xy, score, world, times, size), size, times, score > SEEN_SCORE)


def within(gone: np.ndarray, seen: np.ndarray, times: np.ndarray, config) -> np.ndarray:
    """(T,) bool: gone, in a gap that is short enough or near enough to the seen end of the clip."""
    out = np.zeros(len(gone), bool)
    for first, last in runs(gone):
        earlier, later = times[:first][seen[:first]], times[last:][seen[last:]]
        if len(earlier) and len(later):
            out[first:last] = later[0] - earlier[-1] <= config.max_gap_s
        elif len(earlier) or len(later):
            nearest = earlier[-1] if len(earlier) else later[0]
            out[first:last] = np.abs(times[first:last] - nearest) <= config.max_hold_s
    return out & gone


def predict(tracks: np.ndarray, lead: int, seen: np.ndarray, asked: np.ndarray, body: Turner,
            ) -> np.ndarray:
    """tracks: (T, P, 2) px from the palm; lead: the one of the P that the grid is judged by; seen, asked: (T,) bool.

    Returns places (A, P, 2) px of the asked frames.
    """
    known = chosen(seen, asked, body.times)
    places = [_along(axis, tracks[known][:, :, axis] / body.torso, lead, known, asked, body) for axis in range(2)]
    return np.stack(places, 2) * body.torso


def _along(axis: int, values, lead: int, known, asked, body: Turner) -> np.ndarray:
    """(A, P) along one axis: the processes of the grid, averaged by how likely they make the lead."""
    middle = values.mean(0) if axis else 0.0
    tried = []
    for length, stir, size, basis in body.spectrum(axis, known):
        along = basis.T @ (values - middle)
        for noise in NOISES:
            total = np.maximum(size, 0) + noise**2
            tried.append((-0.5 * (along[:, lead] ** 2 / total + np.log(total)).sum(), length, stir, total, basis, along))
    best = max(entry[0] for entry in tried)
    likely = [entry for entry in tried if entry[0] > best - LIKELY]
    weights = np.exp([entry[0] - best for entry in likely])
    means = []
    for _, length, stir, total, basis, along in likely:
        cross = covariance(axis, body.turn[asked], body.turn[known], body.times[asked], body.times[known], length, stir) @ basis
        means.append(middle + cross / total @ along)
    return np.average(means, 0, weights)


def covariance(axis: int, turn, turn2, time, time2, length: float, stir: float) -> np.ndarray:
    """(n, m) of the places sideways (axis 0) or up and down (axis 1), torso lengths squared."""
    apart = turn[:, None] - turn2
    near = np.exp(-0.5 * ((time[:, None] - time2) / length) ** 2)
    if axis == 0:
        fixed = REACH**2 * np.cos(apart) + OFFSET**2 + BEND**2 * np.cos(2 * apart)
        return fixed + stir**2 * near * (np.cos(apart) + BIAS_SHARE**2)
    return REACH**2 + TILT**2 * np.cos(apart) + BEND**2 * np.cos(2 * apart) + stir**2 * near


def chosen(seen: np.ndarray, asked: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Indices of the seen frames to learn from."""
    known = np.flatnonzero(seen)
    if len(known) <= MOST_FRAMES:
        return known
    near = np.abs(times[known][:, None] - times[asked]).min(1) <= NEAR_S
    room = max(MOST_FRAMES - near.sum(), MOST_FRAMES // 4)
    stride = max(1, int(np.ceil((~near).sum() / room)))
    return np.sort(np.concatenate([known[near], known[~near][::stride]]))
