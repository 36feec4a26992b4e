"""Frames in which the detector took the person's left for the right.

It then sees a back as a front: the turn jumps by half a circle, and back. The turn alone proposes such frames; that the points with
left and right exchanged fit one body in one motion better than as they were found decides. Seen along the view, a front and a back
whose depths are mirrored are one picture: where the network made up the front's depths, too (long hair does it), points fit both
ways. Then the face decides, which another network looks for: a front without a face, in a clip in which fronts have one, is a back.
"""

from __future__ import annotations

import numpy as np

from gsac.stages.findings import runs_of_frames
from gsac.stages.smplx.sightings import TRUNK, Sightings

JUMP = np.radians(60)
"""Cost of a change between right and swapped, in turn: people who turn fast on film with few frames turn by 45 degrees a frame."""
UNLIKELY = np.radians(0.5)
"""Cost of a swapped frame: of two halves that contradict each other the longer one is right."""
MARGIN = 20.0
"""By how much the fit's cost must fall for each exchanged frame. It falls by 29 to 104 where sides were swapped, of three rendered
people at 20 frames, and rises by 79 where pictures are out of order."""
FACING = np.radians(40)
"""Turn from the camera up to which a face is found: on four rendered people 480 px high it is found in most frames up to 45."""
FACES = 0.6
"""Share of the frames that face the camera in which a face must be found: else a front without a face proves nothing."""
CONTRADICTED = np.radians(90)
"""Cost of a frame that its face contradicts, in turn. Two changes between right and swapped cost 300 degrees and more in an even
turn, so that a face that is missed there accuses nobody."""
DEARER = 5.0
"""By how much the fit's cost may rise for each exchanged frame where faces decide, depths there left out."""


def propose_swapped(sightings: Sightings, doubt: np.ndarray | None = None) -> np.ndarray:
    """(T,) bool: frames whose left and right are swapped if the turn from frame to frame is the least (Viterbi); none of photos.

    doubt: (T, 2) rad, cost of each frame as it was found and exchanged; None: none.
    """
    out = np.zeros(len(sightings.xy), bool)
    angle = measure_turn(sightings)
    frames = np.flatnonzero(np.isfinite(angle))
    if len(frames) < 3 or sightings.seconds is None:
        return out
    angle = angle[frames]
    own = np.array([0, UNLIKELY]) + (np.zeros((len(frames), 2)) if doubt is None else doubt[frames])
    step = np.abs(np.angle(np.exp(1j * np.diff(angle))))
    cost, came = own[0], np.zeros((len(frames), 2), int)
    for t, (same, other) in enumerate(zip(step, np.pi - step + JUMP, strict=True), 1):
        ways = cost + np.array([[same, other], [other, same]])  # to, from
        came[t], cost = ways.argmin(1), ways.min(1) + own[t]
    swapped = int(cost.argmin())
    for t in range(len(frames) - 1, -1, -1):
        out[frames[t]], swapped = bool(swapped), came[t, swapped]
    return out


def propose_by_faces(sightings: Sightings) -> np.ndarray:
    """(T,) bool: frames whose left and right are swapped by the turn and the faces, in runs that the faces accuse."""
    doubt, out = doubt_by_faces(sightings), np.zeros(len(sightings.xy), bool)
    for first, last in runs_of_frames(propose_swapped(sightings, doubt)) if doubt.any() else ():
        asis, exchanged = doubt[first:last + 1].sum(0)
        out[first:last + 1] = asis > exchanged
    return out


def believe_by_faces(sightings: Sightings) -> np.ndarray:
    """(T,) bool, frames whose faces contradict that left and right are swapped."""
    return doubt_by_faces(sightings)[:, 1] > 0


def doubt_by_faces(sightings: Sightings) -> np.ndarray:
    """(T, 2) rad, what the faces have against each frame as it was found and against it exchanged; 0 where they tell nothing."""
    angle = np.nan_to_num(measure_turn(sightings), nan=np.pi / 2)
    front, back = np.abs(angle) < FACING, np.abs(angle) > np.pi - FACING
    found = np.zeros(len(angle), bool) if sightings.face is None else sightings.face["valid"].astype(bool)
    if not front.any() or found[front].mean() < FACES:
        return np.zeros((len(angle), 2))
    return CONTRADICTED * np.stack([(front & ~found) | (back & found), (front & found) | (back & ~found)], 1)


def measure_turn(sightings: Sightings) -> np.ndarray:
    """(T,) rad, the trunk's turn as the detector sees it, 0: the person faces the camera; NaN where it is not seen."""
    world = sightings.world.astype(np.float64)
    across = world[:, TRUNK[0]] - world[:, TRUNK[1]] + world[:, TRUNK[2]] - world[:, TRUNK[3]]
    known = np.isfinite(across).all(1) & sightings.seen[:, TRUNK].all(1)
    return np.where(known, np.arctan2(across[:, 2], across[:, 0]), np.nan)
