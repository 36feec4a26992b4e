"""Footage that lies on its side or is upside down though its file does not say so: by how many quarters it has to be turned for its
person to stand.

Phones store what they film across or head down and tag it; who cuts a clip or sends it may lose the tag.
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
"""Lean of a trunk that lies: by 29 degrees it leans in squats, by 36 in a dance, by 76 and more where a camera was held across;
beyond, it is upside down: by 152 and more in squats, by 173 in turns."""
STANDING = np.radians(45)
"""Most lean of the trunk in the turned picture. Where the landmark network takes an empty room for somebody who lies, the turned
room shows nobody, or somebody who hangs head down."""
FILTERS: dict[int, list[str]] = {0: [], 1: ["transpose=cclock"], 2: ["hflip", "vflip"], 3: ["transpose=clock"]}
"""ffmpeg's filters for so many quarters, counter-clockwise as seen."""


def find_quarters(people: People, pictures: Iterable[np.ndarray]) -> int:
    """0 to 3 quarters, counter-clockwise as seen. pictures: (H, W, 3) uint8 of the footage, spread evenly over it.

    People who lie down or stand on the head in some of the pictures are not turned: most must, the same way, and stand once turned.
    """
    told: list[int] = []
    for picture in pictures:
        quarters = _quarters_of(people, picture)
        if quarters is None:
            continue
        if not told and quarters == 0:
            break
        told.append(quarters)
    people.start_anew()
    return next((quarters for quarters in (1, 2, 3) if told.count(quarters) > len(told) / 2), 0)


def lies_on_side(people: People, picture: np.ndarray) -> bool:
    """Whether the person of one picture (H, W, 3) uint8 lies on the side, and stands in the turned one."""
    people.start_anew()
    return _quarters_of(people, picture) in (1, 3)


def _quarters_of(people: People, picture: np.ndarray) -> int | None:
    """Quarters by which the person of one picture (H, W, 3) stands; None where it shows nobody, or one who stands in no turn."""
    lean = people.lean(picture)
    if lean is None:
        return None
    if abs(lean) < LYING[0]:
        return 0
    quarters = 2 if abs(lean) > LYING[1] else 1 if lean > 0 else 3
    people.start_anew()
    after = people.lean(turn(picture, quarters))
    people.start_anew()
    return quarters if after is not None and abs(after) < STANDING else None


def turn(picture: np.ndarray, quarters: int) -> np.ndarray:
    """The picture (H, W, ...), turned by so many quarters, counter-clockwise as seen; itself where it stands."""
    return np.ascontiguousarray(np.rot90(picture, quarters)) if quarters else picture


def describe_quarters(quarters: int) -> Finding:
    """What the user is told."""
    if quarters == 2:
        return Finding.of(Code.TURNED_UPRIGHT, figure=2, lies="is upside down", way="a half")
    return Finding.of(Code.TURNED_UPRIGHT, figure=quarters, lies="lies on the side",
                      way=f"a quarter to the {'left' if quarters == 1 else 'right'}")
