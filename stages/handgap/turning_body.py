"""The turning body around the arms, and a Gaussian process in its frame for a hand's points about the palm.

A point (x, z) of the body appears at x cos y + z sin y sideways when the body has turned by y. Constant x and z with standard
deviation c thus have the covariance c^2 cos(y - y'); where x and z move over time, it is multiplied by a squared exponential of
time. Up and down a point stays, except that perspective lets it sink and rise with the turn. All of it is linear, so the
posterior has a closed form; without a turn it is that of an ordinary Gaussian process.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.gap_frames import pick_frames
from gsac.stages.handgap.missing_hands import runs
from gsac.stages.handgap.turn_estimate import SEEN_SCORE, estimate_turn, locate_centre, smooth_centre

LENGTHS_S = (0.25, 0.4, 0.6, 0.9, 1.4)
"""Grid of the time constant of a point's motion in the body's frame, s."""
MOTIONS = (0.015, 0.03, 0.06, 0.12, 0.24)
"""Grid of the standard deviation of that motion, in torsos."""
NOISES = (0.002, 0.004, 0.008, 0.016)
"""Grid of the detector's noise, in torsos."""
REACH, OFFSET = 0.8, 0.2
"""Prior standard deviation of a point's distance from the body's axis, and of the seen torso's middle from that axis, in torsos."""
TILT, BEND = 0.1, 0.05
"""Standard deviations of what perspective adds up and down with the turn, and with twice the turn, in torsos."""
LIKELY = 4.0
"""Grid entries this far below the best log likelihood get no weight."""
BIAS_SHARE = 0.3
"""Share of the motion that belongs to the image and not to the body: the detector's systematic error."""
MOST_FRAMES = 200
"""Of more seen frames, the points are told from about so many (`pick_frames`)."""


@dataclass
class TurningBody:
    """The body around the arms, over T frames."""

    centre: np.ndarray  # (T, 2) px
    turn: np.ndarray  # (T,) rad
    torso: float
    """px"""
    times: np.ndarray  # (T,) s
    shown: np.ndarray  # (T, 133) bool
    spectra: dict = field(default_factory=dict)
    """Computed spectra by axis and known frames; the parts of one arm share theirs."""

    def spectrum(self, axis: int, known: np.ndarray) -> list[tuple[float, float, np.ndarray, np.ndarray]]:
        """known: (K,) frames. Returns of each process of the grid its time constant s, motion, eigenvalues (K,), vectors (K, K)."""
        key = axis, known.tobytes()
        if key not in self.spectra:
            turn, times = self.turn[known], self.times[known]
            self.spectra[key] = [(length, motion, *np.linalg.eigh(covariance(axis, turn, turn, times, times, length, motion)))
                                 for length, motion in itertools.product(LENGTHS_S, MOTIONS)]
        return self.spectra[key]


def observe_body(xy: np.ndarray, score: np.ndarray, world: np.ndarray, times: np.ndarray, torso: np.ndarray) -> TurningBody:
    """xy: (T, 133, 2) px; score: (T, 133); world: (T, 133, 3) m or NaN; times: (T,) s; torso: (T,) px, inf where not seen."""
    size = float(np.median(torso))
    if not np.isfinite(size):
        seen = xy[score > 0]
        size = max(float(np.ptp(seen, axis=0).max()) / 3, 1.0) if len(seen) else 1.0
    centre = smooth_centre(locate_centre(xy, score), times, size)
    return TurningBody(centre, estimate_turn(xy, score, world, times, size), size, times, score > SEEN_SCORE)


def within_reach(gone: np.ndarray, seen: np.ndarray, times: np.ndarray, config: HandgapConfig) -> np.ndarray:
    """gone, seen: (T,) bool; times: (T,) s. Returns (T,) bool: gone, in a gap of at most `max_gap_s`, or within `max_hold_s` of the
    only seen side."""
    out = np.zeros(len(gone), bool)
    for first, last in runs(gone):
        earlier, later = times[:first][seen[:first]], times[last:][seen[last:]]
        if len(earlier) and len(later):
            out[first:last] = later[0] - earlier[-1] <= config.max_gap_s
        elif len(earlier) or len(later):
            nearest = earlier[-1] if len(earlier) else later[0]
            out[first:last] = np.abs(times[first:last] - nearest) <= config.max_hold_s
    return out & gone


def predict_about_palm(tracks: np.ndarray, lead: int, seen: np.ndarray, asked: np.ndarray, body: TurningBody) -> np.ndarray:
    """tracks: (T, P, 2) px from the palm; lead: index of the point whose likelihood weighs the grid; seen, asked: (T,) bool.

    Returns places (A, P, 2) px from the palm, in the A asked frames.
    """
    known = pick_frames(seen, asked, body.times, MOST_FRAMES)
    places = [_along(axis, tracks[known][:, :, axis] / body.torso, lead, known, asked, body) for axis in range(2)]
    return np.stack(places, 2) * body.torso


def _along(axis: int, values: np.ndarray, lead: int, known: np.ndarray, asked: np.ndarray, body: TurningBody) -> np.ndarray:
    """(A, P) along one axis: the processes of the grid, averaged by the likelihood that they give the lead."""
    middle = values.mean(0) if axis else 0.0
    tried = []
    for length, motion, size, basis in body.spectrum(axis, known):
        along = basis.T @ (values - middle)
        for noise in NOISES:
            total = np.maximum(size, 0) + noise**2
            tried.append((-0.5 * (along[:, lead] ** 2 / total + np.log(total)).sum(), length, motion, total, basis, along))
    best = max(entry[0] for entry in tried)
    likely = [entry for entry in tried if entry[0] > best - LIKELY]
    weights = np.exp([entry[0] - best for entry in likely])
    means = []
    for _, length, motion, total, basis, along in likely:
        cross = covariance(axis, body.turn[asked], body.turn[known], body.times[asked], body.times[known], length, motion) @ basis
        means.append(middle + cross / total @ along)
    return np.average(means, 0, weights)


def covariance(axis: int, turn: np.ndarray, other_turn: np.ndarray, time: np.ndarray, other_time: np.ndarray, length: float,
               motion: float) -> np.ndarray:
    """turn: (n,) rad, other_turn: (m,) rad; time: (n,) s, other_time: (m,) s; length: s; motion: torsos.

    Returns (n, m) torsos squared, of the places sideways (axis 0) or up and down (axis 1).
    """
    apart = turn[:, None] - other_turn
    near = np.exp(-0.5 * ((time[:, None] - other_time) / length) ** 2)
    if axis == 0:
        fixed = REACH**2 * np.cos(apart) + OFFSET**2 + BEND**2 * np.cos(2 * apart)
        return fixed + motion**2 * near * (np.cos(apart) + BIAS_SHARE**2)
    return REACH**2 + TILT**2 * np.cos(apart) + BEND**2 * np.cos(2 * apart) + motion**2 * near
