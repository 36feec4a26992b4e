"""Where footage that is larger than its frames may be is cut before it is scaled, so that scaling takes less of the person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.artifacts import Crop

MARGIN, LEAST_MARGIN = 0.1, 0.03
"""Free space about the person, as a share of the person's height: in a crop as planned, and in one that is accepted."""
CROWN, REACH = 0.08, 0.05
"""From the topmost point, of the face, to the end of the hair, and from the outermost ones to that of fingers, toes and clothes, as
shares of the person's height."""
POINTS_SPAN = 0.91
"""Of a standing person's height, from the eyes' points to the feet's."""
LEAST_GAIN = 1.2
"""Growth of the person's height in px below which footage is left whole."""
LEAST_HEIGHT = 0.1
"""Share of the footage's height below which a person is not believed."""
LEAST_ASPECT = 9 / 16
"""Least width of a crop as a share of its height: masks and the search for a moving camera need some of the scene."""
WIDER = 0.4
"""By how much a crop grows on a side where it hides some of the person, as a share of the person's height."""
SIDES = np.array([-1, -1, 1, 1])
"""Outward direction of left, top, right and bottom."""


@dataclass(frozen=True)
class Extent:
    """Where a clip's person is in the footage, over all frames that were looked at."""

    box: np.ndarray
    """(4,) px, left, top, right, bottom of the person."""
    tall: float
    """px, the person's height."""

    @classmethod
    def of(cls, points: np.ndarray) -> Extent:
        """points: (n, 2) px of one person in one frame."""
        low, high = points.min(0), points.max(0)
        tall = float((high - low).max()) / POINTS_SPAN
        return cls(np.array([*low, *high]) + tall * np.array([-REACH, -CROWN, REACH, REACH]), tall)

    def joined(self, other: Extent | None) -> Extent:
        """Of both."""
        if other is None:
            return self
        return Extent(SIDES * np.maximum(SIDES * self.box, SIDES * other.box), max(self.tall, other.tall))

    def mapped(self, scale: float, x: float = 0.0, y: float = 0.0) -> Extent:
        """In px of a picture that shows this one at `scale`, its corner at x, y."""
        return Extent(self.box * scale + np.array([x, y, x, y]), self.tall * scale)

    def grown(self, sides: np.ndarray) -> Extent:
        """With `WIDER` more on the sides (4,) bool."""
        return Extent(self.box + SIDES * sides * WIDER * self.tall, self.tall)


def plan_crop(extent: Extent, width: int, height: int, max_height: int) -> Crop | None:
    """The crop of footage of width x height px about the person; None where it would gain too little.

    Its numbers are even, since most videos hold one colour for two pixels each way.
    """
    if extent.tall < LEAST_HEIGHT * height:
        return None
    box = extent.box + SIDES * MARGIN * extent.tall
    lacking = max(0.0, LEAST_ASPECT * (box[3] - box[1]) - (box[2] - box[0]))
    box[[0, 2]] += lacking / 2 * np.array([-1, 1])
    box[[0, 2]] -= np.clip(box[0], None, 0) + np.clip(box[2] - width, 0, None)  # what one side lacks the other one gives
    left, top = (2 * int(max(0.0, value) // 2) for value in box[:2])
    right, bottom = (min(end, 2 * int(-(-value // 2))) for value, end in zip(box[2:], (width, height), strict=True))
    kept = min(bottom - top, max_height)
    if kept * height < LEAST_GAIN * (bottom - top) * max_height:
        return None
    return Crop(left, top, right - left, bottom - top, kept / (bottom - top))


def sides_near(extent: Extent, crop: Crop, width: int, height: int, margin: float) -> np.ndarray:
    """(4,) bool, sides of the crop from which the extent, px of the footage of width x height px, is less than a share `margin` of
    the person's height away; the footage's own ends are none."""
    edge = np.array([crop.x, crop.y, crop.x + crop.width, crop.y + crop.height])
    inside = edge != np.array([0, 0, width, height])
    return inside & (SIDES * extent.box + margin * extent.tall > SIDES * edge)


def principal_point(crop: Crop, size: tuple[int, int], width: int, height: int) -> tuple[float, float]:
    """px in frames of this size, of a lens that looks at the middle of footage of width x height px."""
    return (width / 2 - crop.x) * size[0] / crop.width, (height / 2 - crop.y) * size[1] / crop.height


def describe_crop(crop: Crop) -> str:
    """One sentence for the report."""
    return (f"The frames are cut to {crop.width}x{crop.height} px about the person before they are scaled "
            "(split.crop=false keeps them whole).")
