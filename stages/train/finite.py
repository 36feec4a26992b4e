"""Numbers that are not finite stop the training: a gaussian that is not a number is drawn nowhere, and nobody would see it."""

from __future__ import annotations

import numpy as np

from gsac.avatar.gaussians import FIELDS, Gaussians
from gsac.stages.contract import StageError
from gsac.stages.train.poses.poses import Poses


def finite(when: str, quantities: dict[str, np.ndarray | float | None]) -> None:
    """Raises StageError that names the first quantity with a number that is not finite. when: `at step 3`."""
    for name, value in quantities.items():
        if value is not None and not np.isfinite(np.sum(value)):
            raise StageError(f"train: the {name} is not finite {when}; look at smplx/body.npz, or lower the rates (train.*_rate)")


def gradients(grads) -> dict[str, np.ndarray]:
    """Of a rendering, by the names that the user reads."""
    return {f"gradient of {name}": getattr(grads, name) for name in ("vertices", "mu", "quat", "log_scale", "rgb", "opacity")}


def values(gaussians: Gaussians) -> dict[str, np.ndarray]:
    return {name: getattr(gaussians, name) for name in FIELDS}


def pose(poses: Poses, t: int) -> dict[str, np.ndarray]:
    """Of frame t."""
    return {f"pose of frame {t}": poses.pose[t], f"translation of frame {t}": poses.transl[t]}


def result(gaussians: Gaussians, poses: Poses) -> dict[str, np.ndarray | None]:
    """What a training gives."""
    every = {f"pose of frame {t}": poses.pose[t] for t in range(len(poses.pose))}
    return values(gaussians) | {"light": gaussians.light, "betas": poses.betas, "translations": poses.transl, **every}
