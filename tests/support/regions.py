"""Points of a frame in a region's own coordinates, to measure what a region shows."""

import numpy as np

from gsac.avatar.region import Region


def to_region(region: Region, points: np.ndarray) -> np.ndarray:
    """points: (..., 2) px. Returns (..., 2) in 0..1 over the square; the inverse of `Region.to_frame`."""
    return (points - np.asarray(region.center)) @ region.axes / region.side + 0.5
