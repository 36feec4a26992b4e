"""Poses to start from out of a network that the user brings: InstantHMR sees each frame's person, whose points turn the body."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.frame_files import read_frame
from gsac.avatar.instant_hmr import InstantHmr, to_wholebody
from gsac.avatar.joints import J
from gsac.avatar.pose_files.read import Start
from gsac.stages.smplx.sightings import TRUNK, Sightings
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.start.from_points import turn_to_points

ANOTHER = 0.15
"""Share of the person's height by which the network's trunk may lie beside the seen one; beyond it saw somebody else."""


def look(network: InstantHmr, body: Body, frames: Iterable[Path], outlines: list[Outline], sightings: Sightings,
         progress: Callable[[int, int, str], None]) -> Start:
    """The poses of T frames in the camera's axes; NaN where nobody, or somebody else, was seen. Place and shape are left open."""
    rotations = np.full((len(outlines), J, 3, 3), np.nan)
    for t, (path, outline) in enumerate(zip(frames, outlines, strict=True)):
        if outline.area > 0:
            xy, points = network.read(read_frame(path), find_box(outline))
            seen = sightings.seen[t, TRUNK]
            off = np.linalg.norm(to_wholebody(xy)[TRUNK] - sightings.xy[t, TRUNK], axis=1)[seen]
            if not seen.any() or off.mean() < ANOTHER * sightings.person_height:
                rotations[t] = turn_to_points(body, to_wholebody(points))
        progress(t + 1, len(outlines), "frames")
    return Start(rotations, np.full((len(outlines), 3), np.nan))


def find_box(outline: Outline) -> np.ndarray:
    """The person's left, top, right, bottom (4,) px, by the alpha."""
    rows, columns = (np.flatnonzero(outline.mask.any(axis)) for axis in (1, 0))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]) * outline.scale
