"""A second look at frames in which the person was lost or seen too small, for the head is outside the picture.

The person detector goes by the head: without one it misses the person, or finds a smaller one in the trunk. The landmark network
needs no head where it is told where to look, and a frame nearby, in which the person was found, tells it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gsac.avatar.region import Region
from gsac.stages.keypoints.cut_off import Cut
from gsac.stages.keypoints.detection import Frame

SHRUNK = 0.85
"""Side of a region, over the usual one's, below which the person was seen too small: the trunk alone gives 0.6 to 0.7, side
views of headless people 0.65 to 0.85; looking again below 0.75 alone mends fewer of them, below 0.9 no more."""
LEAST_CUT = 0.1
"""Share of the frames, and three at least, in which the head must be cut off."""


def look_again(frames: list[Frame], cuts: list[set[Cut]], look: Callable[[int, Region], tuple[Frame, set[Cut]] | None]) -> None:
    """Replaces frames and what is cut off in them where a second look finds a person of the usual size.

    look: (frame's number, region) -> what is found there.
    """
    headless = [f.region.side for f, cut in zip(frames, cuts, strict=True) if Cut.HEAD in cut and f.region is not None]
    if len(headless) < max(3, LEAST_CUT * len(frames)):
        return
    least = SHRUNK * np.median(headless)
    right = np.array([f.region is not None and f.region.side >= least for f in frames])
    for t in np.flatnonzero(~right).tolist():
        near = np.flatnonzero(right)
        region = frames[near[np.abs(near - t).argmin()]].region
        found = look(t, region) if region is not None else None
        if found is not None and found[0].region is not None and found[0].region.side >= least:
            frames[t], cuts[t] = found
            right[t] = True
