"""Faults of what comes with the clip, and of what the fit hands to training: focal length, poses, places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.benchmarks.stability.fault import Fault, Origin
from gsac.benchmarks.stability.take import Take


def give_focal(take: Take, factor: float, rng: np.random.Generator) -> tuple[Take, np.ndarray]:
    """factor: of the focal length that the file says, over the true one. Returns the take and frames (T,) bool."""
    true = take.truth.focal * take.size[0] / (2 * take.truth.center[1])
    return replace(take, focal=factor * true), np.ones(len(take.frames), bool)


def disturb_poses(body: dict[str, np.ndarray], degrees: float, rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """degrees: standard deviation of each joint's rotation. body: arrays (T, ...) by name. Returns it and frames (T,) bool."""
    pose = body["body_pose"]
    return body | {"body_pose": pose + np.radians(rng.normal(0, degrees, pose.shape)).astype(pose.dtype)}, np.ones(len(pose), bool)


def slide(body: dict[str, np.ndarray], metres: float, rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """metres: standard deviation of the body's place. body: arrays (T, ...) by name. Returns it and frames (T,) bool."""
    place = body["transl"]
    return body | {"transl": place + rng.normal(0, metres, place.shape).astype(place.dtype)}, np.ones(len(place), bool)


FAULTS = (
    Fault("focal-short", "given focal length over the true one", (0.8, 0.65, 0.5, 0.33, 0.2), give_focal),
    Fault("focal-long", "given focal length over the true one", (1.25, 1.5, 2.0, 3.0, 5.0), give_focal),
    Fault("pose-noise", "standard deviation of each joint, degrees; training only", (0.5, 1, 2, 4, 8), disturb_poses, Origin.BODY),
    Fault("sliding", "standard deviation of the body's place, m; training only", (0.002, 0.005, 0.01, 0.02, 0.05), slide,
          Origin.BODY),
)
