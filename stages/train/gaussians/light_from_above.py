"""How much more light comes from above than from below, told by places of one material that face up here and down there.

A person who turns about the vertical keeps the slope of each place: a darker underside may be paint as well as shade, and the
frames leave the vertical part of the light to the colours. An arm that is lifted, or a trunk that bends, then carries its shade
along. But near places of one hue are mostly of one material, and its paint does not know which way is up.
"""

from __future__ import annotations

import numpy as np
from scipy.cluster.vq import kmeans2

MATERIALS = 48
"""Groups of places that are near each other and of like hue."""
APART = 0.5
"""m between two places that part them as much as hues that differ by a factor of e."""
ROUNDS = 10
"""Of the robust fit."""
OUTLIER = 1.5
"""Standard deviations of brightness beyond which a place counts less: another material, or a cast shadow."""
USUAL, TRUST = 0.2, 0.7
"""The share of light from above in most rooms and under most skies, and how much what is measured counts beside it."""
DARK = 0.01
"""Added to colours in 0..1, of which logarithms are taken."""


def find_from_above(rgb: np.ndarray, up: np.ndarray, places: np.ndarray) -> float:
    """Slope of the light by the upward part of the normal, over the light of a place that faces sideways.

    rgb: (N, 3) in 0..1, seen in a light without such a slope; up: (N,) upward part of unit normals; places: (N, 3) m at rest.
    """
    if len(rgb) < MATERIALS:
        return USUAL
    logs = np.log(rgb.astype(np.float64) + DARK)
    brightness = logs.mean(1)
    material = kmeans2(np.column_stack([logs - brightness[:, None], places / APART]), MATERIALS, minit="++", rng=0)[1]
    slope, counted = 0.0, np.ones(len(rgb))
    for _ in range(ROUNDS):
        off = np.abs(centre(brightness - slope * up, material, counted))
        counted = np.minimum(1, OUTLIER * 1.48 * np.median(off) / np.maximum(off, 1e-9))
        facing = centre(up, material, counted)
        slope = float((counted * facing) @ brightness / max(float(counted @ facing**2), 1e-9))
    return TRUST * slope + (1 - TRUST) * USUAL


def centre(values: np.ndarray, material: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """values (N,) less the mean, by weight (N,), of those of their material (N,), a number below MATERIALS."""
    total = np.bincount(material, weight, MATERIALS)
    return values - (np.bincount(material, weight * values, MATERIALS) / np.maximum(total, 1e-12))[material]
