"""What a detector finds in one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gsac.avatar.region import Region


def _nan(*shape: int):
    return field(default_factory=lambda: np.full(shape, np.nan, np.float32))


def _zero(*shape: int):
    return field(default_factory=lambda: np.zeros(shape, np.float32))


@dataclass
class Frame:
    """Starts as a frame in which nobody is seen. A point whose score is 0 was not seen and its place means nothing."""

    xy: np.ndarray = _zero(133, 2)
    """(133, 2) px, COCO-WholeBody order."""
    score: np.ndarray = _zero(133)
    """(133,) in 0..1."""
    world: np.ndarray = _nan(133, 3)
    """(133, 3) m, hips at 0, OpenCV axes; NaN where unknown."""
    pose33: np.ndarray = _zero(33, 3)
    """(33, 3) BlazePose's x, y px and visibility; zeros where nobody is seen."""
    face_mesh: np.ndarray = _nan(468, 3)
    """(468, 3) px; NaN where no face is found."""
    region: Region | None = None
    """Where the followed person is; not part of the file."""
    others: list[Region] = field(default_factory=list)
    """Where others are seen beside the followed person; not part of the file."""

    @property
    def seen(self) -> bool:
        return bool(self.score.any())
