"""sRGB's curve between display values and linear light (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np


def to_linear(display: np.ndarray) -> np.ndarray:
    """Linear light (...) of display values (...), both in 0..1; below 0 the curve goes on straight."""
    return np.where(display > 0.04045, ((np.maximum(display, 0) + 0.055) / 1.055) ** 2.4, display / 12.92)


def to_display(linear: np.ndarray) -> np.ndarray:
    """Display values (...) of linear light (...), both in 0..1; below 0 the curve goes on straight."""
    return np.where(linear > 0.0031308, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055, linear * 12.92)
