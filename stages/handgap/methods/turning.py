"""A whole arm as one Gaussian process: small rotations of its joints about the arm's usual pose, in the frame of the turning body.

A point at r from a joint that turns by a small w moves by w x r. Trunk, shoulder, elbow and wrist each turn as a process of their
own over time and carry what hangs below them, so a seen elbow tells where the hidden palm has gone. The usual pose is fitted to
all seen frames: a point (x, z) of the body appears at x cos y + z sin y sideways when the body has turned by y. The image
coordinates are linear in all of this, so the posterior has a closed form; without a turn it is that of an arm in the image plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from gsac.avatar.wholebody import ARM, HANDS
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.gap_frames import pick_frames
from gsac.stages.handgap.method import Detections, Filled, HiddenArm
from gsac.stages.handgap.methods.gp import noise_px
from gsac.stages.handgap.missing_hands import runs
from gsac.stages.handgap.turning_body import LIKELY, TurningBody, predict_about_palm, within_reach

LENGTHS_S = (0.3, 0.45, 0.65, 1.0)
"""Grid of the rotations' time constant, s."""
SIZES = (0.03, 0.06, 0.12, 0.25, 0.5)
"""Grid of their standard deviation, rad."""
SHARES = (0.4, 1.0, 1.0, 1.0)
"""Factors on it for trunk, shoulder, elbow and wrist."""
LOOSE, LOOSE_SHARE = 0.01, 0.1
"""Standard deviation of each point's own motion, in torsos, and its growth a rad of rotation: large ones are not linear."""
LINKS = np.array((0.45, 0.6, 0.55, 0.25))
"""Prior lengths, in torsos: body's centre to shoulder, upper arm, forearm, palm."""
TILT, BEND, OFFSET = np.array((0.05, 0.07, 0.1, 0.1)), 0.05, 0.02
"""Standard deviations of perspective's part, in torsos: up and down with the turn, with twice the turn, constant in the image."""
SYSTEMATIC = np.array((0.02, 0.02, 0.02, 0.01))
"""Standard deviation of the detector's systematic error, in torsos; it changes smoothly with the turn."""
LEAST_NOISE = 0.002
"""Least standard deviation of the detector's noise, in torsos."""
RIDGE = 0.3
"""Regularises the usual pose where the body hardly turns, in frames."""
HIPS = np.array((0, 0.5, 0))
"""Pivot of the trunk, in torsos from the body's centre."""
MOST_FRAMES = 100
"""In a clip of more frames each gap is filled by itself, from about so many (`pick_frames`)."""


@dataclass
class Coordinates:
    """n image coordinates of arm points, one row each."""

    point: np.ndarray  # (n,) 0 shoulder, 1 elbow, 2 wrist, 3 palm
    axis: np.ndarray  # (n,) 0 sideways, 1 up and down
    frame: np.ndarray  # (n,)
    ray: np.ndarray  # (n, 3) the coordinate's derivative by the body's x, y, z
    turn: np.ndarray  # (n,) rad
    time: np.ndarray  # (n,) s

    @classmethod
    def of(cls, shown: np.ndarray, body: TurningBody) -> Coordinates:
        """Both coordinates of every point and frame in shown (4, T) bool."""
        point, frame = (np.tile(i, 2) for i in np.nonzero(shown))
        axis = np.repeat([0, 1], len(point) // 2)
        turn = body.turn[frame]
        sideways = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
        return cls(point, axis, frame, np.where(axis[:, None] == 0, sideways, [0.0, 1, 0]), turn, body.times[frame])


class Covariance:
    """Of n and m coordinates, torsos squared; computed once but for what depends on the rotations' time constant and size."""

    def __init__(self, a: Coordinates, b: Coordinates, usual: np.ndarray):
        """usual: (4, 3) torsos, the arm's usual pose."""
        same, along = a.point[:, None] == b.point, a.ray @ b.ray.T
        apart = a.turn[:, None] - b.turn
        wave = np.cos(apart)
        twice = 2 * wave**2 - 1
        alike = same & (a.axis[:, None] == b.axis)
        reach = np.cumsum(LINKS**2)[np.minimum(a.point[:, None], b.point)]
        tilt = np.where(a.axis == 1, TILT[a.point] ** 2, 0)[:, None]
        self.fixed = reach * along + alike * (tilt * wave + BEND**2 * twice + OFFSET**2)
        self.systematic = alike * (SYSTEMATIC**2)[a.point, None] * (wave + twice + wave * (4 * wave**2 - 3)) / 3
        self.carried = np.zeros_like(along)
        for joint, pivot in enumerate((HIPS, *usual[:3])):
            below = (a.point[:, None] >= joint) & (b.point >= joint)
            arm, other = usual[a.point] - pivot, usual[b.point] - pivot
            self.carried += SHARES[joint] ** 2 * below * ((arm @ other.T) * along - (a.ray @ other.T) * (arm @ b.ray.T))
        self.loose = same * along
        self.squared_s = (a.time[:, None] - b.time) ** 2

    def at(self, length: float, size: float) -> np.ndarray:
        """length: s; size: rad. Returns (n, m): of the true places, without the detector's systematic error."""
        motion = size**2 * self.carried + (LOOSE**2 + (LOOSE_SHARE * size) ** 2) * self.loose
        return self.fixed + np.exp(-0.5 / length**2 * self.squared_s) * motion


def fill_arm(out: Filled, arm: HiddenArm, detections: Detections, config: HandgapConfig) -> None:
    """The method `turning`, a `FillArm`."""
    body, (elbow, wrist, hand), chain = detections.body, arm.lost, ARM[arm.side]
    measured = out.xy.copy()
    shown = np.stack([body.shown[:, chain[0]], *~arm.unsure])
    asked = np.zeros_like(shown)
    for part, lost in enumerate((elbow, wrist, hand)):
        asked[part + 1] = lost & within_reach(lost, ~arm.unsure[part], body.times, config) & shown[part + 1].any()
    if not asked.any():
        return
    place, spread = predict(measured[:, chain] - body.centre[:, None], shown, asked, body)
    for part, points in enumerate(([chain[1]], [chain[2]], np.arange(133)[HANDS[arm.side]])):
        here = asked[part + 1]
        if not here.any():
            continue
        fill = body.centre[here, None] + place[here, part + 1, None]
        if part == 2:  # the other points lie about the palm, and turn with the body
            about = measured[:, points] - measured[:, chain[3], None]
            fill = fill + predict_about_palm(about, 0, shown[3], here, body)
        out.xy[np.ix_(here, points)], out.filled[np.ix_(here, points)] = fill, True
        out.drift[np.ix_(here, points)] = np.sqrt((spread[here, part + 1] ** 2).mean(1))[:, None]


def predict(tracks: np.ndarray, shown: np.ndarray, asked: np.ndarray, body: TurningBody) -> tuple[np.ndarray, np.ndarray]:
    """tracks: (T, 4, 2) px of shoulder, elbow, wrist and palm from the body's centre; shown, asked: (4, T) bool.

    Returns places (T, 4, 2) px and their standard deviation (T, 4, 2) px; zeros where not asked.
    """
    tracks = tracks / body.torso
    usual = np.stack([fit_usual_place(tracks[:, i], shown[i], body.turn) for i in range(4)])
    noise = np.array([max(noise_px(tracks[:, i], shown[i]), LEAST_NOISE) for i in range(4)])
    place, spread = np.zeros_like(tracks), np.zeros_like(tracks)
    gaps = [asked]
    if len(tracks) > MOST_FRAMES:
        gaps = [asked & (np.arange(len(tracks)) >= a) & (np.arange(len(tracks)) < b)
                for a, b in runs(asked.any(0)) if asked[:, a].any()]
    for gap in gaps:
        use = np.zeros(len(tracks), bool)
        use[pick_frames(np.any(gap | shown, axis=0), np.any(gap, axis=0), body.times, MOST_FRAMES)] = True
        _predict_gap(tracks, shown & use, gap, usual, noise, body, place, spread)
    return place * body.torso, spread * body.torso


def _predict_gap(tracks: np.ndarray, shown: np.ndarray, asked: np.ndarray, usual: np.ndarray, noise: np.ndarray, body: TurningBody,
                 place: np.ndarray, spread: np.ndarray) -> None:
    """Writes place and spread (T, 4, 2), in torsos, where asked (4, T): the grid's processes, averaged by their likelihood.

    usual: (4, 3) torsos; noise: (4,) torsos; the rest as for `predict`, in torsos.
    """
    given, wanted = Coordinates.of(shown, body), Coordinates.of(asked, body)
    middle = np.where(given.axis == 1, usual[given.point, 1], 0)
    values = tracks[given.frame, given.point, given.axis] - middle
    between, cross = Covariance(given, given, usual), Covariance(wanted, given, usual)
    tried = []
    for length in LENGTHS_S:
        fits = []
        for size in SIZES:
            total = between.at(length, size) + between.systematic
            total[np.diag_indices_from(total)] += noise[given.point] ** 2
            factor = cholesky(total, lower=True, overwrite_a=True, check_finite=False)
            white = solve_triangular(factor, values, lower=True, check_finite=False)
            fits.append((-0.5 * white @ white - np.log(np.diag(factor)).sum(), length, size, factor, white))
            if fits[-1][0] < max(fit[0] for fit in fits) - LIKELY:
                break  # larger ones are less likely still
        tried += fits
    best = max(entry[0] for entry in tried)
    likely = [entry for entry in tried if entry[0] > best - LIKELY]
    itself = Covariance(wanted, wanted, usual)
    means, variances = [], []
    for _, length, size, factor, white in likely:
        seen = solve_triangular(factor, cross.at(length, size).T, lower=True, check_finite=False)
        means.append(seen.T @ white)
        variances.append(np.maximum(np.diag(itself.at(length, size)) - (seen**2).sum(0), 0))
    weights = np.exp([entry[0] - best for entry in likely])
    mean = np.average(means, 0, weights)
    variance = np.average(np.array(variances) + (means - mean) ** 2, 0, weights)
    at = wanted.frame, wanted.point, wanted.axis
    place[at] = mean + np.where(wanted.axis == 1, usual[wanted.point, 1], 0)
    spread[at] = np.sqrt(variance)


def fit_usual_place(track: np.ndarray, shown: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """track: (T, 2) torsos from the body's centre; shown: (T,) bool; turn: (T,) rad.

    Returns (3,) torsos in the body's frame, by least squares; 0 where never shown.
    """
    if not shown.any():
        return np.zeros(3)
    waves = np.stack([np.cos(turn), np.sin(turn)], 1)[shown]
    x, z = np.linalg.solve(waves.T @ waves + RIDGE * np.eye(2), waves.T @ track[shown, 0])
    return np.array([x, track[shown, 1].mean(), z])
