"""The arm as a chain of small rotations about its usual pose, in the frame of the turning body; one Gaussian process for all of it.

A point at r from a joint that turns by the small w moves by w x r, so the elbow says where the hidden palm has gone: every joint
of trunk, shoulder, elbow and wrist turns as a process of its own in time, and carries what hangs below it. The usual pose is
read off all seen frames: sideways a point (x, z) of the body lies at x cos y + z sin y for the turn y. What is seen is linear in
all of that, so the answer is in closed form; where nothing turns it is that of an arm in the picture's plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from gsac.avatar.wholebody import ARM, HANDS
from gsac.stages.handgap import turning_body
from gsac.stages.handgap.gp import noise_px
from gsac.stages.handgap.missing_hands import runs

LENGTHS_S = (0.3, 0.45, 0.65, 1.0)
"""Grid of the rotations' time constant."""
SIZES = (0.03, 0.06, 0.12, 0.25, 0.5)
"""Grid of their standard deviation, rad."""
SHARES = (0.4, 1.0, 1.0, 1.0)
"""Of it that trunk, shoulder, elbow and wrist take."""
LOOSE, LOOSE_SHARE = 0.01, 0.1
"""Torso lengths that each point stirs by itself; and for each rad of the rotations, which are not always small."""
LINKS = np.array((0.45, 0.6, 0.55, 0.25))
"""Torso lengths to the shoulder from the body's centre, and of upper arm, forearm and palm: nothing else is known beforehand."""
TILT, BEND, OFFSET = np.array((0.05, 0.07, 0.1, 0.1)), 0.05, 0.02
"""Torso lengths: what perspective adds up and down with the turn, both ways with twice the turn, and what keeps to the image."""
HABIT = np.array((0.02, 0.02, 0.02, 0.01))
"""Torso lengths that the detector errs by, smoothly in the view."""
LEAST_NOISE = 0.002
RIDGE = 0.3
"""Frames' worth of doubt about a point's place along a line of sight that hardly turns."""
HIPS = np.array((0, 0.5, 0))
"""What the trunk turns about: torso lengths below the body's centre."""
LIKELY = 4.0
"""Log likelihood below the best of the grid from which on a process has no say."""
MOST_FRAMES, NEAR_S = 100, 1.5
"""Of a longer clip each gap is told from the seen frames this close to it and every n-th of the others."""


@dataclass
class Sights:
    """n coordinates of chain points in the image, one row each."""

    point: np.ndarray  # (n,) 0 shoulder, 1 elbow, 2 wrist, 3 palm
    axis: np.ndarray  # (n,) 0 sideways, 1 up and down
    frame: np.ndarray  # (n,)
    ray: np.ndarray  # (n, 3) what the coordinate is of the body's x, y, z
    turn: np.ndarray  # (n,) rad
    time: np.ndarray  # (n,) s

    @classmethod
    def of(cls, shown: np.ndarray, body: turning_body.Turner) -> Sights:
        """shown: (4, T) bool."""
        point, frame = (np.tile(i, 2) for i in np.nonzero(shown))
        axis = np.repeat([0, 1], len(point) // 2)
        turn = body.turn[frame]
        sideways = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
        return cls(point, axis, frame, np.where(axis[:, None] == 0, sideways, [0.0, 1, 0]), turn, body.times[frame])


class Covariance:
    """Of two sets of sights, (n, m), torso lengths squared, as a function of the rotations' time constant and size."""

    def __init__(self, a: Sights, b: Sights, usual: np.ndarray):
        """usual: (4, 3) torso lengths, the arm's usual pose."""
        same, along = a.point[:, None] == b.point, a.ray @ b.ray.T
        apart = a.turn[:, None] - b.turn
        wave = np.cos(apart)
        twice = 2 * wave**2 - 1
        alike = same & (a.axis[:, None] == b.axis)
        reach = np.cumsum(LINKS**2)[np.minimum(a.point[:, None], b.point)]
        tilt = np.where(a.axis == 1, TILT[a.point] ** 2, 0)[:, None]
        self.fixed = reach * along + alike * (tilt * wave + BEND**2 * twice + OFFSET**2)
        self.habit = alike * (HABIT**2)[a.point, None] * (wave + twice + wave * (4 * wave**2 - 3)) / 3
        self.carried = np.zeros_like(along)
        for joint, pivot in enumerate((HIPS, *usual[:3])):
            below = (a.point[:, None] >= joint) & (b.point >= joint)
            arm, other = usual[a.point] - pivot, usual[b.point] - pivot
            self.carried += SHARES[joint] ** 2 * below * ((arm @ other.T) * along - (a.ray @ other.T) * (arm @ b.ray.T))
        self.loose = same * along
        self.squared_s = (a.time[:, None] - b.time) ** 2

    def at(self, length: float, size: float) -> np.ndarray:
        """Of where the points are, the detector's habits left out."""
        stir = size**2 * self.carried + (LOOSE**2 + (LOOSE_SHARE * size) ** 2) * self.loose
        return self.fixed + np.exp(-0.5 / length**2 * self.squared_s) * stir


def fill_arm(xy, filled, drift, side: str, lost, unsure, body: turning_body.Turner, config) -> None:
    """xy (T, 133, 2), filled (T, 133) and drift (T, 133) in place.

    lost: (3, T) bool, frames of elbow, wrist and hand to fill; unsure: (3, T) bool, frames not to learn from.
    """
    measured, chain = xy.copy(), ARM[side]
    shown = np.stack([body.shown[:, chain[0]], *~unsure])
    asked = np.zeros_like(shown)
    for part in range(3):
        asked[part + 1] = lost[part] & turning_body.within(lost[part], ~unsure[part], body.times, config) & shown[part + 1].any()
    if not asked.any():
        return
    place, spread = predict(measured[:, chain] - body.centre[:, None], shown, asked, body)
    for part, points in enumerate(([chain[1]], [chain[2]], np.arange(133)[HANDS[side]])):
        here = asked[part + 1]
        if not here.any():
            continue
        fill = body.centre[here, None] + place[here, part + 1, None]
        if part == 2:  # the other points lie about the palm, and turn with the body
            about = measured[:, points] - measured[:, chain[3], None]
            fill = fill + turning_body.predict(about, 0, shown[3], here, body)
        xy[np.ix_(here, points)], filled[np.ix_(here, points)] = fill, True
        drift[np.ix_(here, points)] = np.sqrt((spread[here, part + 1] ** 2).mean(1))[:, None]


def predict(tracks: np.ndarray, shown: np.ndarray, asked: np.ndarray, body: turning_body.Turner) -> tuple[np.ndarray, np.ndarray]:
    """tracks: (T, 4, 2) px of shoulder, elbow, wrist and palm from the body's centre; shown, asked: (4, T) bool.

    Returns places (T, 4, 2) px and their standard deviation, where asked.
    """
    tracks = tracks / body.torso
    usual = np.stack([usual_place(tracks[:, i], shown[i], body.turn) for i in range(4)])
    noise = np.array([max(noise_px(tracks[:, i], shown[i]), LEAST_NOISE) for i in range(4)])
    place, spread = np.zeros_like(tracks), np.zeros_like(tracks)
    gaps = [asked]
    if len(tracks) > MOST_FRAMES:
        gaps = [asked & (np.arange(len(tracks)) >= a) & (np.arange(len(tracks)) < b)
                for a, b in runs(asked.any(0)) if asked[:, a].any()]
    for gap in gaps:
        answer(tracks, shown & near(gap.any(0), shown.any(0), body.times), gap, usual, noise, body, place, spread)
    return place * body.torso, spread * body.torso


def answer(tracks, shown, asked, usual, noise, body, place, spread) -> None:
    """Fills place and spread (T, 4, 2), torso lengths, where asked: the processes of the grid, averaged by their likelihood."""
    told, wanted = Sights.of(shown, body), Sights.of(asked, body)
    middle = np.where(told.axis == 1, usual[told.point, 1], 0)
    said = tracks[told.frame, told.point, told.axis] - middle
    between, cross = Covariance(told, told, usual), Covariance(wanted, told, usual)
    tried = []
    for length in LENGTHS_S:
        fits = []
        for size in SIZES:
            total = between.at(length, size) + between.habit
            total[np.diag_indices_from(total)] += noise[told.point] ** 2
            factor = cholesky(total, lower=True, overwrite_a=True, check_finite=False)
            white = solve_triangular(factor, said, lower=True, check_finite=False)
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


def usual_place(track: np.ndarray, shown: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """track: (T, 2) torso lengths. (3,) in the body's frame, by least squares; at the centre where never shown."""
    if not shown.any():
        return np.zeros(3)
    waves = np.stack([np.cos(turn), np.sin(turn)], 1)[shown]
    x, z = np.linalg.solve(waves.T @ waves + RIDGE * np.eye(2), waves.T @ track[shown, 0])
    return np.array([x, track[shown, 1].mean(), z])


def near(asked: np.ndarray, shown: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(T,) bool: the frames to learn from."""
    out = np.zeros(len(times), bool)
    known = np.flatnonzero(shown | asked)
    if len(times) <= MOST_FRAMES:
        out[known] = True
        return out
    close = np.abs(times[known][:, None] - times[asked]).min(1) <= NEAR_S
    room = max(MOST_FRAMES - close.sum(), MOST_FRAMES // 4)
    stride = max(1, int(np.ceil((~close).sum() / room)))
    out[known[close]] = out[known[~close][::stride]] = True
    return out
