"""A square, turned region of a frame: the crop that a network sees, and its points back in the frame.

Pixels are continuous: the first pixel's centre is (0.5, 0.5). Region coordinates run 0..1 over the square.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Region:
    """Centre, side and angle of the square."""

    center: tuple[float, float]
    """Pixels."""
    side: float
    """Pixels."""
    angle: float = 0.0
    """Radians, from the frame's x axis towards its y axis (clockwise as seen)."""

    @property
    def axes(self) -> np.ndarray:
        """(2, 2), columns are the region's x and y axes in the frame, unit length."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s], [s, c]])

    def to_frame(self, points: np.ndarray) -> np.ndarray:
        """Maps points (..., 2) from the region's coordinates, 0..1, to the frame's, px."""
        return (points - 0.5) * self.side @ self.axes.T + np.asarray(self.center)

    def turn(self, points: np.ndarray) -> np.ndarray:
        """Turns points (..., 3) from the region's axes to the frame's, about z."""
        return np.concatenate([points[..., :2] @ self.axes.T, points[..., 2:]], axis=-1)

    def moved(self, right: float, down: float) -> Region:
        """Shifted along its own axes by fractions of its side."""
        center = self.to_frame(np.array([0.5 + right, 0.5 + down]))
        return Region((float(center[0]), float(center[1])), self.side, self.angle)

    def scaled(self, factor: float) -> Region:
        """The same with another side."""
        return Region(self.center, self.side * factor, self.angle)

    def box(self) -> np.ndarray:
        """(4,) x0 y0 x1 y1 px of the untilted square."""
        half = self.side / 2
        return np.array([self.center[0] - half, self.center[1] - half, self.center[0] + half, self.center[1] + half])


def full_frame(width: int, height: int) -> Region:
    """The square that holds the whole frame, bars on the short sides."""
    return Region((width / 2, height / 2), float(max(width, height)))


def upright_angle(start: np.ndarray, end: np.ndarray, target: float) -> float:
    """Angle of the region, -pi..pi, in which the direction from start (2,) to end (2,), px, points to `target`: radians,
    counter-clockwise as seen, pi/2 is up."""
    angle = target - np.arctan2(-(end[1] - start[1]), end[0] - start[0])
    return float(angle - 2 * np.pi * np.floor((angle + np.pi) / (2 * np.pi)))


def around_circle(center: np.ndarray, rim: np.ndarray, target: float = np.pi / 2) -> Region:
    """The square about a circle, turned so that its rim point lies towards `target`, rad. center, rim: (2,) px."""
    side = 2 * float(np.hypot(*(rim - center)))
    return Region((float(center[0]), float(center[1])), side, upright_angle(center, rim, target))


def around_points(points: np.ndarray, angle: float = 0.0, tight: bool = False) -> Region:
    """The square about points (n, 2) px; tight: bounding box in the turned axes, else in the frame's."""
    if not tight:
        low, high = points.min(axis=0), points.max(axis=0)
        center = (low + high) / 2
        return Region((float(center[0]), float(center[1])), float(max(high - low)), angle)
    turned = Region((0.0, 0.0), 1.0, angle)
    along = points @ turned.axes
    low, high = along.min(axis=0), along.max(axis=0)
    center = turned.axes @ ((low + high) / 2)
    return Region((float(center[0]), float(center[1])), float(max(high - low)), angle)


def crop(image: np.ndarray, region: Region, size: int, outside: str = "edge") -> np.ndarray:
    """The region of an image (H, W, 3) uint8 as (size, size, 3) float32 in 0..1.

    outside: fill beyond the frame, `edge` (repeat) or `black`. Where the crop shrinks the frame by two or more, the frame is
    averaged down first so that thin parts do not alias.
    """
    import cv2

    shrink = max(1, int(region.side / size))
    if shrink > 1:
        image, region = _shrink(image, region, shrink)
    step = region.side / size
    axes = region.axes * step
    # Output pixel centre (i + 0.5) maps to frame point; OpenCV counts from pixel centres at 0.
    origin = np.asarray(region.center) - axes @ np.array([size / 2, size / 2])
    shift = origin + axes @ np.array([0.5, 0.5]) - 0.5
    matrix = np.hstack([axes, shift[:, None]])
    border = cv2.BORDER_REPLICATE if outside == "edge" else cv2.BORDER_CONSTANT
    flags = cv2.WARP_INVERSE_MAP | (cv2.INTER_LINEAR if step > 0.7 else cv2.INTER_CUBIC)
    out = cv2.warpAffine(image, matrix, (size, size), flags=flags, borderMode=border)
    return out.astype(np.float32) / 255


def _shrink(image: np.ndarray, region: Region, factor: int) -> tuple[np.ndarray, Region]:
    """The part of the frame under the region averaged down by a whole factor, and the region in it."""
    import cv2

    height, width = image.shape[:2]
    reach = region.side * 0.75
    x0, y0 = (max(0, int(c - reach) // factor * factor) for c in region.center)
    x1, y1 = min(width, int(region.center[0] + reach) + 1), min(height, int(region.center[1] + reach) + 1)
    if x1 - x0 < factor or y1 - y0 < factor:
        return image, region
    x1, y1 = x0 + (x1 - x0) // factor * factor, y0 + (y1 - y0) // factor * factor
    small = cv2.resize(image[y0:y1, x0:x1], ((x1 - x0) // factor, (y1 - y0) // factor), interpolation=cv2.INTER_AREA)
    center = ((region.center[0] - x0) / factor, (region.center[1] - y0) / factor)
    return small, Region(center, region.side / factor, region.angle)
