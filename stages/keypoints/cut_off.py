"""What the edge of the picture cuts off the person."""

from __future__ import annotations

from enum import Enum

import numpy as np

from gsac.stages.frame_names import name_frames
from gsac.stages.keypoints.detection import Frame

EDGE = 0.004
"""Width of the rim of the frame, as a part of its longer side, that counts as outside."""
HEAD33, FEET33 = [*range(11), 33], slice(27, 33)
HEAD23, FEET23 = slice(0, 5), slice(15, 23)
"""Points of the head, and of ankles and feet: of BlazePose's 33 and the crown, and of COCO-WholeBody's body and feet."""


class Cut(Enum):
    """What the edge of the picture cuts off the person, in the words of the warning."""

    HEAD = "the head"
    FEET = "the feet"
    SIDE = "a side of the body"
    OTHER = "an arm or a leg"


def find_cuts(frame: Frame, width: int, height: int) -> set[Cut]:
    """What of the person lies on the frame's rim or outside of it: body points, and the crown extrapolated above the eyes. Sizes
    in px."""
    rim = EDGE * max(width, height)
    if frame.pose33.any():
        xy, head, feet = frame.pose33[:, :2], HEAD33, FEET33
        eyes, mouth = xy[[2, 5]].mean(axis=0), xy[[9, 10]].mean(axis=0)
        xy = np.vstack([xy, eyes + 1.6 * (eyes - mouth)])
    else:
        xy, head, feet = np.where(frame.score[:23, None] > 0, frame.xy[:23], np.nan), HEAD23, FEET23
    above, below = xy[:, 1] < rim, xy[:, 1] > height - rim
    aside = (xy[:, 0] < rim) | (xy[:, 0] > width - rim)
    found = {Cut.HEAD: above[head].any(), Cut.FEET: below[feet].any(), Cut.SIDE: aside.any(),
             Cut.OTHER: (above | below).any() and not above[head].any() and not below[feet].any()}
    return {cut for cut, is_so in found.items() if is_so}


def name_cuts(cuts: list[set[Cut]]) -> str:
    """`the head in frame 3, the feet in 12 of 60 frames (0-11)`. cuts: one for each frame."""
    frames = {cut: np.array([cut in found for found in cuts]) for cut in Cut}
    return ", ".join(f"{cut.value} in {name_frames(mask)}" for cut, mask in frames.items() if mask.any())
