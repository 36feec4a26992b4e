"""Picks the frames of a clip that are kept, and their size."""

from __future__ import annotations

import numpy as np


def pick_by_time(times: np.ndarray, fps: float | None, count: int | None) -> np.ndarray:
    """times: (N,) s, rising. Returns (K,) rising indices of the kept frames.

    They are nearest to an even grid in time: `fps` a second, or `count` from first to last where that is fewer.
    """
    span = float(times[-1] - times[0])
    wanted = len(times) if fps is None else int(np.floor(span * fps + 1e-6)) + 1
    if count is not None and wanted > count:
        grid = np.linspace(times[0], times[-1], count)
    elif fps is None:
        return np.arange(len(times))
    else:
        grid = times[0] + np.arange(wanted) / fps
    right = np.clip(np.searchsorted(times, grid), 1, max(1, len(times) - 1))
    right = np.minimum(right, len(times) - 1)
    left = np.maximum(right - 1, 0)
    # A tie goes to the earlier frame; the tolerance keeps it so under rounding.
    nearest = np.where(grid - times[left] <= times[right] - grid + 1e-9, left, right)
    return np.unique(nearest)


def pick_evenly(n: int, count: int | None) -> np.ndarray:
    """Returns (K,) indices of at most `count` of n photos; the first and the last are among them."""
    if count is None or n <= count:
        return np.arange(n)
    return np.unique(np.round(np.linspace(0, n - 1, count)).astype(int))


def fit_size(width: int, height: int, max_height: int | None) -> tuple[int, int]:
    """Width and height, px, with the height at most max_height and the aspect kept to the nearest pixel."""
    if max_height is None or height <= max_height:
        return width, height
    return max(1, round(width * max_height / height)), max_height


def turn_size(width: int, height: int, quarters: int) -> tuple[int, int]:
    """Width and height of a picture after that."""
    return (height, width) if quarters % 2 else (width, height)
