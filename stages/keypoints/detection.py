"""What a detector says of one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


def _nan(*shape: int):
    return field(default_factory=lambda: np.full(shape, np.nan, np.float32))


def _zero(*shape: int):
    return field(default_factory=lambda: np.zeros(shape, np.float32))


@dataclass
class Frame:
    """Starts as a frame in which nobody is seen. A point whose score is 0 was not seen and its place means nothing."""

    xy: np.ndarray = _zero(133, 2)
    """px, COCO-WholeBody order."""
    score: np.ndarray = _zero(133)
    world: np.ndarray = _nan(133, 3)
    """m, hips at 0, OpenCV axes."""
    pose33: np.ndarray = _zero(33, 3)
    """BlazePose x, y px and visibility; zeros from detectors that have none."""
    face_mesh: np.ndarray = _nan(468, 3)
    """px."""
    second_person: bool = False
    """Whether somebody else is seen beside the followed person; not part of the file."""

    @property
    def seen(self) -> bool:
        return bool(self.score.any())


ARRAYS = ("xy", "score", "world", "pose33", "face_mesh")
