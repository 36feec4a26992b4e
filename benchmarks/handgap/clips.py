"""Key points for the measurements: turning bodies with simulated detection errors, and real detections of rendered clips."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.camera import Camera
from gsac.avatar.wholebody import LEFT_HAND
from gsac.turntable.clip import place_person, pose_person
from gsac.turntable.motion import make_motion
from gsac.turntable.options import TurntableOptions
from gsac.turntable.person import make_person
from gsac.turntable.viewpoint import Viewpoint

BODY_NOISE, HAND_NOISE = 2.4, 1.0
"""Standard deviation of the noise, px, for a person 930 px tall; measured on rendered clips, as are the next two."""
BODY_HABIT, HAND_HABIT = 6.0, 3.0
"""Standard deviation of the systematic error that depends on the yaw, px."""
WORLD_NOISE, WORLD_HABIT = 0.015, 0.03
"""Both for the points in metres."""


@dataclass
class HandClip:
    """Detected and true key points of T frames."""

    truth: np.ndarray  # (T, 133, 2) px
    xy: np.ndarray  # (T, 133, 2) px, as detected
    score: np.ndarray  # (T, 133)
    world: np.ndarray  # (T, 133, 3) m, as detected
    times: np.ndarray  # (T,) s


def make_turning_body(seed: int, frames: int = 80, habit: float = 1.0, noise: float = 1.0) -> HandClip:
    """Simulates detections of a turning person. habit, noise: factors on the systematic error and on the noise."""
    options = TurntableOptions(seed=seed, frames=frames)
    person = make_person(options, np.random.default_rng([seed, 1]))
    motion = make_motion(person.body, person.joints, options, np.random.default_rng([seed, 2]))
    width, height = options.size
    camera = Camera((options.focal_px,) * 2, (width / 2, height / 2), width, height)
    view = Viewpoint(camera, np.diag([1.0, -1.0, -1.0]), np.array([0, 1.25, options.focal_px * person.height_m / (0.73 * height)]))
    params = place_person(person, motion, view)
    points = np.stack([person.body.keypoints(pose_person(person, params, t)[0]) for t in range(frames)])
    truth = camera.project(points)
    rng = np.random.default_rng([seed, 6])
    sizes, habits = np.full(133, BODY_NOISE), np.full(133, BODY_HABIT)
    sizes[LEFT_HAND.start:], habits[LEFT_HAND.start:] = HAND_NOISE, HAND_HABIT
    xy = truth + noise * rng.normal(0, 1, truth.shape) * sizes[:, None] + habit * habits[:, None] * make_habit(motion.yaw, 2, rng)
    world = points - points[:, [11, 12]].mean(1, keepdims=True) + WORLD_NOISE * rng.normal(0, 1, points.shape)
    return HandClip(truth, xy, np.full(truth.shape[:2], 0.95), world + WORLD_HABIT * make_habit(motion.yaw, 3, rng),
                    np.arange(frames) / options.fps)


def make_habit(yaw: np.ndarray, axes: int, rng: np.random.Generator) -> np.ndarray:
    """Random error (T, 133, axes), smooth in yaw (T,) rad, of standard deviation 1."""
    waves = np.concatenate([[np.cos(k * yaw), np.sin(k * yaw)] for k in (1, 2, 3)])
    return np.einsum("wt,wpa->tpa", waves, rng.normal(0, 1, (6, 133, axes))) / np.sqrt(3)


def read_detections(run: Path, truth: Path) -> HandClip:
    """Detections of a run on a rendered clip. truth: its truth.npz. Raises ArtifactError."""
    seen, known = read_arrays(run / "keypoints" / "keypoints.npz"), read_arrays(truth)
    times = np.arange(len(seen["xy"])) / float(known["fps"])
    return HandClip(known["keypoints"].astype(float), seen["xy"].astype(float), seen["score"].astype(float),
                    seen["world"].astype(float), times)
