"""FLIP: perceived difference of two images that alternate in one place (Andersson et al. 2020), for low dynamic range.

Colour: opponent channels filtered by the eye's contrast sensitivity, Hunt-adjusted CIELAB, HyAB distance. Features: edges
and points of the lightness. All constants are the paper's.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.srgb import to_linear

PIXELS_PER_DEGREE = 67.0
"""A 0.7 m wide 3840 px monitor from 0.7 m."""
QC, PC, PT, QF = 0.7, 0.4, 0.95, 0.5
FEATURE_DEGREES = 0.082
SENSITIVITY = (((1.0, 0.0047), (0.0, 1e-5)), ((1.0, 0.0053), (0.0, 1e-5)), ((34.1, 0.04), (13.5, 0.025)))
"""(a1, b1), (a2, b2) of achromatic, red-green and blue-yellow: sum of a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees."""
TO_XYZ = np.array([[10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
                   [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
                   [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382]])
WHITE_POINT = TO_XYZ.sum(1)


def flip(reference: np.ndarray, test: np.ndarray, pixels_per_degree: float = PIXELS_PER_DEGREE) -> np.ndarray:
    """Difference (H, W) in 0..1, 0 where equal. reference, test: (H, W, 3) sRGB in 0..1."""
    opponents = [_to_opponent(to_linear(np.asarray(image, np.float32))) for image in (reference, test)]
    filtered = [_adjust_hunt(_to_lab(_filter_contrast(o, pixels_per_degree))) for o in opponents]
    corners = _adjust_hunt(_to_lab(np.array([[[0.0, 1, 0], [0, 0, 1]]])))
    largest = float(_hyab(corners[:, :1], corners[:, 1:])[0, 0]) ** QC
    colour = _hyab(*filtered) ** QC
    knee = PC * largest
    colour = np.where(colour < knee, PT / knee * colour, PT + (colour - knee) / (largest - knee) * (1 - PT))
    features = [_features((o[..., 0] + 16) / 116, pixels_per_degree) for o in opponents]
    strongest = np.max([np.abs(a - b) for a, b in zip(*features, strict=True)], axis=0)
    return np.clip(colour, 0, 1) ** (1 - np.clip(strongest / np.sqrt(2), 0, 1) ** QF)


def _to_opponent(linear: np.ndarray) -> np.ndarray:
    """YCxCz of linear RGB."""
    x, y, z = np.moveaxis(_mix(linear, TO_XYZ / WHITE_POINT[:, None]), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], -1)


def _filter_contrast(opponent: np.ndarray, ppd: float) -> np.ndarray:
    """Linear RGB in 0..1 of opponent channels, filtered by the eye's contrast sensitivity; ppd: pixels per degree."""
    radius = int(np.ceil(3 * np.sqrt(0.04 / (2 * np.pi**2)) * ppd))
    at = np.arange(-radius, radius + 1) / ppd
    out = np.empty_like(opponent)
    for c, terms in enumerate(SENSITIVITY):
        # each gaussian of x^2 + y^2 is a product; the weights make the whole kernel sum to one
        parts = [(a * np.sqrt(np.pi / b), np.exp(-np.pi**2 * at**2 / b)) for a, b in terms if a]
        total = sum(weight * line.sum() ** 2 for weight, line in parts)
        out[..., c] = sum(weight / total * _convolve(opponent[..., c], line, line) for weight, line in parts)
    y = (out[..., 0] + 16) / 116
    xyz = np.stack([y + out[..., 1] / 500, y, y - out[..., 2] / 200], -1)
    return np.clip(_mix(xyz, np.linalg.inv(TO_XYZ) * WHITE_POINT), 0, 1)


def _to_lab(linear: np.ndarray) -> np.ndarray:
    ratio = _mix(linear, TO_XYZ / WHITE_POINT[:, None])
    limit = 6 / 29
    f = np.where(ratio > limit**3, np.cbrt(ratio), ratio / (3 * limit**2) + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1)


def _adjust_hunt(lab: np.ndarray) -> np.ndarray:
    return np.concatenate([lab[..., :1], 0.01 * lab[..., :1] * lab[..., 1:]], -1)


def _hyab(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(a[..., 0] - b[..., 0]) + np.hypot(a[..., 1] - b[..., 1], a[..., 2] - b[..., 2])


def _features(lightness: np.ndarray, ppd: float) -> tuple[np.ndarray, np.ndarray]:
    """Strength of edges and of points."""
    deviation = 0.5 * FEATURE_DEGREES * ppd
    radius = int(np.ceil(3 * deviation))
    at = np.arange(-radius, radius + 1)
    plain = np.exp(-(at**2) / (2 * deviation**2))
    smooth = plain / plain.sum()
    found = []
    for kernel in (-at * plain, (at**2 / deviation**2 - 1) * plain):
        kernel = np.where(kernel > 0, kernel / kernel[kernel > 0].sum(), kernel / -kernel[kernel < 0].sum())
        found.append(np.hypot(_convolve(lightness, smooth, kernel), _convolve(lightness, kernel, smooth)))
    return tuple(found)


def _mix(image: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(H, W, 3): the matrix (3, 3) applied to each pixel."""
    import cv2

    return cv2.transform(image, matrix)


def _convolve(image: np.ndarray, down: np.ndarray, across: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.sepFilter2D(image, -1, across, down, borderType=cv2.BORDER_REPLICATE)
