"""Finds stretches of a clip that are mirrored, by the room behind the person, which stands still."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import frame_paths
from gsac.avatar.frame_files import read_frame, write_frame

APART = 6.0
"""Median change of a block, of 255, from which on two pictures of the room differ: a symmetric or plain one tells no side."""
ALIKE = 0.4
"""How much nearer the mirrored picture must be."""


def find_mirrored(blocks: np.ndarray) -> np.ndarray:
    """blocks: (T, h, w, 3), 0..255. Returns (T,) bool, the pictures whose room is the mirror image of most others'; of two halves
    the first picture's is right. The person moves too few blocks to sway a median."""
    first = blocks[0]
    plain, turned = (np.median(np.abs(each - first), (1, 2, 3)) for each in (blocks, blocks[:, :, ::-1]))
    other = (plain > APART) & (turned < ALIKE * plain)
    return ~other if other.sum() > len(other) / 2 else other


def turn_back(frames: Path, mirrored: np.ndarray) -> None:
    """Mirrors those frames of a folder again. mirrored: (T,) bool."""
    paths = frame_paths(frames)
    for t in np.flatnonzero(mirrored):
        picture = read_frame(paths[t])
        write_frame(paths[t], np.ascontiguousarray(picture[:, ::-1]))
