"""Footage that lies on its side though its file does not say so: by how many quarters it has to be turned for its person to stand.

Phones store what they film across and tag it; who cuts a clip or sends it may lose the tag.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gsac.stages.findings import Code, Finding
from gsac.stages.split.people import People

LOOKS = 5
"""Pictures that tell, at most. The first one ends the search where its person stands, as in nearly all footage."""
LARGE_ENOUGH = 640
"""px, height of these pictures, at most: the detector sees 224."""
LYING = np.radians((60, 120))
"""Lean of a trunk that lies: by 29 degrees it leans in squats, by 36 in a dance, by 76 and more where a camera was held across."""
FILTERS: dict[int, list[str]] = {0: [], 1: ["transpose=cclock"], 3: ["transpose=clock"]}
"""ffmpeg's filters for so many quarters, counter-clockwise as seen."""


def find_quarters(people: People, pictures: Iterable[np.ndarray]) -> int:
    """0, 1 or 3 quarters, counter-clockwise as seen. pictures: (H, W, 3) uint8 of the footage, spread evenly over it.

    People who lie down in some of the pictures are not turned: most must lie, and to the same side.
    """
    leans: list[float] = []
    for picture in pictures:
        lean = people.lean(picture)
        if lean is None:
            continue
        if not leans and abs(lean) < LYING[0]:
            break
        leans.append(lean)
    people.start_anew()
    for quarters, sign in ((1, 1), (3, -1)):
        if sum(LYING[0] < sign * lean < LYING[1] for lean in leans) > len(leans) / 2:
            return quarters
    return 0


def turn(picture: np.ndarray, quarters: int) -> np.ndarray:
    """The picture (H, W, ...), turned by so many quarters, counter-clockwise as seen; itself where it stands."""
    return np.ascontiguousarray(np.rot90(picture, quarters)) if quarters else picture


def describe_quarters(quarters: int) -> Finding:
    """What the user is told."""
    return Finding.of(Code.TURNED_UPRIGHT, figure=quarters, way="left" if quarters == 1 else "right")
