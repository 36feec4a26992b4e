"""Smooths a finished fit over time."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

WINDOW, ORDER = 9, 2
"""Frames and degree of the published Savitzky-Golay filter."""


def smooth_rotations(local: np.ndarray) -> np.ndarray:
    """Filters local (T, J, 3, 3) as continuous quaternions; clips shorter than the window stay as they are."""
    if len(local) < WINDOW:
        return local
    quats = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(*local.shape[:2], 4)
    flips = np.sign((quats[1:] * quats[:-1]).sum(-1, keepdims=True))
    quats[1:] *= np.cumprod(np.where(flips == 0, 1, flips), axis=0)
    smooth = savgol_filter(quats, WINDOW, ORDER, axis=0)
    return Rotation.from_quat(smooth.reshape(-1, 4)).as_matrix().reshape(local.shape)


def smooth_linear(values: np.ndarray) -> np.ndarray:
    """Filters values (T, n); clips shorter than the window stay as they are."""
    return savgol_filter(values, WINDOW, ORDER, axis=0) if len(values) >= WINDOW else values
