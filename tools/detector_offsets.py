"""Measures a detector's systematic errors on truth clips: offsets of its key points, and their change with the body's yaw.

    python -m gsac.turntable CLIPS/201 --seed 201 --frames 30 --fps 5; gsac run CLIPS/201/clip.mp4 --until keypoints ...
    python tools/detector_offsets.py RUN TRUTH [RUN TRUTH ...] --out stages/smplx/offsets/mediapipe.npz

The kept file was measured on 120 people, seeds 201 to 320, those that end in 1 or 2 with `--feet planted`.

RUN is a run's folder (keypoints/keypoints.npz), TRUTH the clip's truth.npz. A detector's hip is not the body's hip: robust least
squares over all frames and clips finds one constant offset (3,) m of each point, in the axes of the joint that carries it most. The
residuals are fitted by harmonics of the body's yaw, x and y as a share of the person's height (the point's habit); the standard
deviation of the rest is its spread. Each person's own offsets are regressed on the betas of their figure (in a long trunk a hip is
detected higher); the directions in which people still differ are kept. Left and right share everything, mirrored.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.artifacts import read_arrays, write_arrays
from gsac.avatar.body import Body
from gsac.avatar.wholebody import BODY_NAMES, FACE, FEET_NAMES, INDEX, LEFT_HAND, RIGHT_HAND
from gsac.avatar.yaw import yaw
from gsac.stages.smplx.detector_errors import HARMONICS, PERSONAL, UNKNOWN, Detector, harmonics
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.symmetry import mirror_directions

POSE = ("global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose", "left_hand_pose", "right_hand_pose")
RIDGE = 2000.0
"""Ridge, px^2 / m^2, on the offset that all people share."""
HABIT_RIDGE = 2.0
"""Ridge on a habit's harmonics, in sightings; doubled for the highest."""
FIGURE_RIDGE = 1e-4
"""Ridge on the betas beyond the truth's, m^2 summed over the vertices."""
LEAST_SPREAD = 0.002
"""Smallest spread of a point, as a share of the person's height."""
OWN_RIDGE = (8.0 / 0.02) ** 2
"""Ridge on one person's own offset: (px of a sighting's error / m of the difference between people)^2."""
PEOPLE_RIDGE = 10.0
"""Ridge on the slopes of an offset by the betas, in people."""
LEAST_OWN = 0.002
"""Smallest standard deviation, m, of a direction in which people differ."""
FEW = 20
"""Sightings below which a point is not measured."""


@dataclass
class SeenClip:
    """One clip: detections and truth."""

    xy: np.ndarray  # (T, 133, 2) px
    seen: np.ndarray  # (T, 133) bool
    height: float  # px, of the person as the fit measures it
    points: np.ndarray  # (T, 133, 3) m, the body's true points, camera frame
    turn: np.ndarray  # (T, 55, 3, 3) of the joints to the camera frame
    focal: float
    center: np.ndarray  # (2,) px
    figure: np.ndarray  # (F,) betas of the person's figure

    @classmethod
    def read(cls, body: Body, run: Path, truth: Path) -> SeenClip:
        """Reads a run's folder and its clip's truth.npz."""
        seen, z = read_arrays(run / "keypoints" / "keypoints.npz"), read_arrays(truth)
        pose = np.concatenate([z[name] for name in POSE], 1).reshape(-1, 55, 3)
        score = seen["score"]
        height = Sightings(seen["xy"], score, score, seen["world"], None, 0, 0, None).person_height
        return cls(seen["xy"].astype(np.float64), score > 0.5, height, body.keypoints(z["vertices"].astype(np.float32)),
                   chain_rotations(body, pose), float(np.ravel(z["focal"])[0]), z["center"], fit_figure(body, z))

    def slope(self, points: np.ndarray) -> np.ndarray:
        """Derivative (n, 2, 3) of the pixels by the points (n, 3) m, camera frame."""
        x, y, z = points.T
        none = np.zeros_like(z)
        return self.focal * np.stack([np.stack([1 / z, none, -x / z**2], -1), np.stack([none, 1 / z, -y / z**2], -1)], 1)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of points (..., 3) m, camera frame."""
        return self.focal * points[..., :2] / points[..., 2:] + self.center


def fit_figure(body: Body, truth: dict[str, np.ndarray]) -> np.ndarray:
    """Betas (F,) nearest to the true bare body, which the basis does not span.

    truth: `betas` (F,), `shift` (V, 3) m of the vertices, `joint_offset` (55, 3) m.
    """
    basis = body.shapedirs[:, :, : body.num_figure].reshape(-1, body.num_figure).astype(np.float64)
    beyond = (truth["shift"] - truth["joint_offset"][0]).ravel()  # about the pelvis, as the basis is
    return truth["betas"] + np.linalg.solve(basis.T @ basis + FIGURE_RIDGE * np.eye(body.num_figure), basis.T @ beyond)


def find_carriers(body: Body) -> np.ndarray:
    """Joint (133,) that carries each key point most; -1 for points that the body does not have."""
    carried = np.abs(body.keypoint_matrix) @ body.weights
    return np.where(body.known_keypoints, np.asarray(carried).argmax(1), -1)


def find_counterparts() -> np.ndarray:
    """Index (133,) of each body, foot and hand point's counterpart on the other side; of face points their own."""
    out = np.arange(133)
    for name in (*BODY_NAMES, *FEET_NAMES):
        side, _, rest = name.partition("_")
        if side in ("left", "right"):
            out[INDEX[name]] = INDEX[("right_" if side == "left" else "left_") + rest]
    out[LEFT_HAND], out[RIGHT_HAND] = np.arange(RIGHT_HAND.start, RIGHT_HAND.stop), np.arange(LEFT_HAND.start, LEFT_HAND.stop)
    return out


def chain_rotations(body: Body, pose: np.ndarray) -> np.ndarray:
    """Rotations (T, 55, 3, 3) of the joints to the camera frame. pose: (T, 55, 3) rotation vectors."""
    world = rotation.exp(np.asarray(pose, np.float64))
    for j, p in enumerate(body.parents[1:], 1):
        world[:, j] = world[:, p] @ world[:, j]
    return world


def measure_offsets(body: Body, clips: list[SeenClip]) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (133, 3) m in the carrying joint's T-pose axes, and the median px distance before and after (133, 2)."""
    joint, other = find_carriers(body), find_counterparts()
    rows: list[list] = [[] for _ in range(133)]
    for clip in clips:
        for p in np.nonzero(joint >= 0)[0]:
            for t in np.nonzero(clip.seen[:, p])[0]:
                x = clip.points[t, p]
                rows[p].append((clip.slope(x[None])[0] @ clip.turn[t, joint[p]], clip.xy[t, p] - clip.project(x)))
    flip = np.array([-1.0, 1, 1])
    offsets, quality = np.zeros((133, 3)), np.full((133, 2), np.nan)
    for p in np.nonzero(joint >= 0)[0]:
        both = rows[p] + [(j * flip, a) for j, a in rows[other[p]]] if other[p] != p else rows[p]
        if len(both) < FEW:
            continue
        jacobian, away = np.stack([j for j, _ in both]), np.stack([a for _, a in both])
        offsets[p] = fit_offset(jacobian, away, RIDGE)
        quality[p] = np.median(np.linalg.norm(away, axis=1)), np.median(np.linalg.norm(away - jacobian @ offsets[p], axis=1))
    return offsets, quality


def fit_offset(slope: np.ndarray, away: np.ndarray, ridge: float) -> np.ndarray:
    """Offset (3,) m that explains residuals away (R, 2) px best, robustly. slope: (R, 2, 3) px / m; ridge: px^2 / m^2."""
    offset = np.zeros(3)
    for _ in range(8):
        left = np.linalg.norm(away - slope @ offset, axis=1)
        w = 1 / (1 + (left / (2 * np.median(left) + 1e-6)) ** 2) ** 2
        normal = np.einsum("r,rab,rac->bc", w, slope, slope) + ridge * np.eye(3)
        offset = np.linalg.solve(normal, np.einsum("r,rab,ra->b", w, slope, away))
    return offset


def measure_habits(body: Body, clips: list[SeenClip], offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Habit (133, 2 H + 1, 2) and spread (133,) of the residuals that the offsets (133, 3) m leave; zero and wide for the face."""
    joint, other = find_carriers(body), find_counterparts()
    habit, spread = np.zeros((133, 2 * HARMONICS + 1, 2)), np.full(133, UNKNOWN)
    pull = HABIT_RIDGE * np.diag([1e-9, *([1.0] * (HARMONICS - 1) + [2.0]) * 2])
    left = []
    for clip in clips:
        moved = clip.points + np.einsum("tpab,pb->tpa", clip.turn[:, joint], offsets)
        use = (clip.seen & (joint >= 0))[..., None]
        left.append((clip.xy - clip.project(np.where(use, moved, 1.0))) / np.where(use, clip.height, np.nan))
    yaws = [yaw(clip.turn[:, 0]) for clip in clips]
    for p in np.setdiff1d(np.nonzero(joint >= 0)[0], np.arange(FACE.start, FACE.stop)):
        basis = np.concatenate([harmonics(sign * turned) for turned in yaws for sign in (1, -1)])
        value = np.concatenate([x for e in left for x in (e[:, p], e[:, other[p]] * [-1, 1])])
        known = np.isfinite(value).all(1)
        if known.sum() < FEW:
            continue
        basis, value, weight = basis[known], value[known], np.ones(known.sum())
        for _ in range(6):
            heavy = basis * weight[:, None]
            habit[p] = np.linalg.solve(basis.T @ heavy + pull, heavy.T @ value)
            rest = np.linalg.norm(value - basis @ habit[p], axis=1)
            weight = 1 / (1 + (rest / (3 * np.median(rest) + 1e-9)) ** 2) ** 2
        spread[p] = max(np.sqrt(np.average(rest**2, weights=weight) / 2), LEAST_SPREAD)
    return habit, spread


def measure_own_offsets(body: Body, clip: SeenClip, offsets: np.ndarray, habit: np.ndarray) -> np.ndarray:
    """One person's offsets (len(PERSONAL), 3) m beyond offsets (133, 3) m and habit (133, 2 H + 1, 2), in the left side's axes."""
    joint, flip = find_carriers(body), np.array([-1.0, 1, 1])
    usual = Detector(offsets, None, None, habit, None).error(yaw(clip.turn[:, 0])) * clip.height
    moved = clip.points + np.einsum("tpab,pb->tpa", clip.turn[:, joint], offsets)
    out = np.zeros((len(PERSONAL), 3))
    for n, name in enumerate(PERSONAL):
        slopes, aways = [], []
        for point, sign in ((INDEX[f"left_{name}"], 1), (INDEX[f"right_{name}"], flip)):
            t = np.flatnonzero(clip.seen[:, point])
            slopes.append(clip.slope(moved[t, point]) @ clip.turn[t, joint[point]] * sign)
            aways.append(clip.xy[t, point] - clip.project(moved[t, point]) - usual[t, point])
        slope, away = np.concatenate(slopes), np.concatenate(aways)
        if len(away) >= FEW:
            out[n] = fit_offset(slope, away, OWN_RIDGE)
    return out


def measure_people(figures: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Common offsets (133, 3) m, slopes by the betas (133, 3, F), and directions (133, 3, K) m in which people still differ.

    figures: (N, F) betas; own: (N, len(PERSONAL), 3) m.
    """
    values = own.reshape(len(own), -1)
    wide = np.column_stack([np.ones(len(own)), figures])
    pull = PEOPLE_RIDGE * np.diag([0.0] + [1.0] * figures.shape[1])
    by = np.linalg.solve(wide.T @ wide + pull, wide.T @ values)  # (1 + F, 3 n)
    left = values - wide @ by
    variance, directions = np.linalg.eigh(np.cov(left.T))
    kept = variance > LEAST_OWN**2
    axes = mirror_directions(dict.fromkeys(PERSONAL, (1, 1, 1)), INDEX, 133)[0]
    return axes @ by[0], axes @ by[1:].T, axes @ (directions * np.sqrt(np.maximum(variance, 0)))[:, kept][:, ::-1]


def main() -> None:
    """Writes the measured errors, and prints the body's points."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("paths", nargs="+", type=Path, help="RUN TRUTH pairs")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    if len(options.paths) % 2 or len(options.paths) < 4:
        parser.error(f"{len(options.paths)} paths were given; expected RUN TRUTH of at least two clips")
    body = Body.load()
    clips = [SeenClip.read(body, *pair) for pair in zip(options.paths[::2], options.paths[1::2], strict=True)]
    offsets, quality = measure_offsets(body, clips)
    habit, spread = measure_habits(body, clips, offsets)
    own = np.stack([measure_own_offsets(body, clip, offsets, habit) for clip in clips])
    common, by_betas, directions = measure_people(np.stack([clip.figure for clip in clips]), own)
    kept = Detector(offsets + common, by_betas, directions, habit, spread)
    arrays = {f.name: getattr(kept, f.name).astype(np.float32) for f in fields(kept)}
    write_arrays(options.out, **arrays, model=np.array(body.digest))
    for name in (*BODY_NAMES, *FEET_NAMES, "left_hand_wrist", "left_hand_middle1", "left_hand_middle4"):
        i = INDEX[name]
        print(f"{name:18} {quality[i, 0]:6.1f} -> {quality[i, 1]:5.1f} px   {np.round(1e3 * kept.offsets[i])} mm   "
              f"habit {np.round(1e3 * np.linalg.norm(habit[i], axis=-1), 1)}, rest {1e3 * spread[i]:.1f} of 1000")


if __name__ == "__main__":
    main()
