"""What was measured of a detector: where its points lie against the body's own, and how that changes as the person turns.

A network that has seen few backs and sides bends what it finds there towards what it knows: an ear slides, a hidden wrist comes
nearer. The same person turned the same way is seen the same wrong way again, so that it can be measured and taken off.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body
from gsac.avatar.wholebody import INDEX
from gsac.stages.smplx.symmetry import mirror_directions

FILES = {"mediapipe": Path(__file__).parent / "offsets" / "mediapipe.npz"}
"""`tools/detector_offsets.py` measures them on truth clips."""
HARMONICS = 3
UNKNOWN, UNKNOWN_FACE = 0.006, 0.009
"""Spreads of a detector that was not measured; eyes, ears and nose: it means other places than the body's points."""
PERSONAL = {"shoulder": (6, 4, 3), "elbow": (8, 3, 3), "wrist": (7, 2, 2), "hip": (4, 17, 3), "knee": (4, 12, 4),
            "ankle": (2, 7, 3), "big_toe": (3, 5, 5), "heel": (3, 6, 5)}
"""Points that a detector places differently on different people, and by how many mm if it was not measured."""


@dataclass
class Detector:
    """133 points of COCO-WholeBody; 2 H + 1 harmonics of the yaw: 1, cos 1..H, sin 1..H."""

    offsets: np.ndarray  # (133, 3) m, in the T-pose axes of the joint that carries the point
    by_betas: np.ndarray  # (133, 3, F) m a unit, how the offsets change with the figure's betas
    own: np.ndarray
    """(133, 3, K) m, in the same axes: how people differ in what is left of the offsets, a standard deviation each direction."""
    habit: np.ndarray  # (133, 2 H + 1, 2) shares of the person's height in pixels
    spread: np.ndarray  # (133,) of what is left, the same shares

    @classmethod
    def load(cls, name: str, body: Body) -> Detector:
        """The detector of this name; one without habits where it or this body was not measured."""
        arrays = read_arrays(FILES[name]) if name in FILES else None
        if arrays is None or str(arrays["model"]) != body.digest:
            spread = np.full(133, UNKNOWN)
            spread[:5] = UNKNOWN_FACE
            own, metres = mirror_directions(PERSONAL, INDEX, 133)
            return cls(np.zeros((133, 3)), np.zeros((133, 3, 0)), own * metres, np.zeros((133, 2 * HARMONICS + 1, 2)), spread)
        return cls(*(arrays[f.name].astype(np.float64) for f in fields(cls)))

    def slopes(self, body: Body) -> np.ndarray:
        """(133, 3, B) m a unit, how the offsets change with all of the body's betas."""
        return np.pad(self.by_betas, ((0, 0), (0, 0), (0, body.num_betas - self.by_betas.shape[2])))

    def error(self, yaw: np.ndarray) -> np.ndarray:
        """yaw: (T,) rad. Returns (T, 133, 2): what the detector adds to the true place, as a share of the person's height."""
        return np.einsum("th,phc->tpc", harmonics(yaw), self.habit)


def harmonics(yaw: np.ndarray) -> np.ndarray:
    """(T, 2 H + 1)."""
    angle = np.multiply.outer(yaw, np.arange(1, HARMONICS + 1))
    return np.concatenate([np.ones((len(yaw), 1)), np.cos(angle), np.sin(angle)], 1)
