"""Stops the training at numbers that are not finite: a gaussian with NaN is drawn nowhere, and nobody would see the fault."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gsac.avatar.gaussians import FIELDS, Gaussians
from gsac.avatar.raster import BoundGradients
from gsac.stages.contract import StageError
from gsac.stages.train.poses.poses import Poses


def require_finite(when: str, quantities: Mapping[str, np.ndarray | float | None]) -> None:
    """Raises StageError that names the first quantity with a number that is not finite.

    when: `at step 3`; quantities: name -> (...), a scalar, or None, which passes.
    """
    for name, value in quantities.items():
        if value is not None and not np.isfinite(np.sum(value)):
            raise StageError(f"train: the {name} is not finite {when}; look at smplx/body.npz, or lower the rates (train.*_rate)")


def named_gradients(grads: BoundGradients) -> dict[str, np.ndarray]:
    """Name for the user -> gradient (V, 3) or (N, ...) of a rendering."""
    return {f"gradient of {name}": getattr(grads, name) for name in ("vertices", "mu", "quat", "log_scale", "rgb", "opacity")}


def named_values(gaussians: Gaussians) -> dict[str, np.ndarray]:
    """Name -> (N, ...)."""
    return {name: getattr(gaussians, name) for name in FIELDS}


def named_pose(poses: Poses, t: int) -> dict[str, np.ndarray]:
    """Name -> pose (55, 3) and translation (3,) of frame t."""
    return {f"pose of frame {t}": poses.pose[t], f"translation of frame {t}": poses.transl[t]}


def named_result(gaussians: Gaussians, poses: Poses) -> dict[str, np.ndarray | None]:
    """Name -> array (...) of all that a training gives."""
    every = {f"pose of frame {t}": poses.pose[t] for t in range(len(poses.pose))}
    return named_values(gaussians) | {"light": gaussians.light, "betas": poses.betas, "translations": poses.transl, **every}
