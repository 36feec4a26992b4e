"""A motion that an avatar's file carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Animation:
    """Axis-angle keys of some joints at a fixed rate, linear between keys."""

    fps: float
    loop: bool
    joints: list[str]
    rotation: np.ndarray
    """(K, n, 3) rad, relative to the parent joint, of the n listed joints; the others do not turn."""
    transl: np.ndarray
    """(K, 3) m, added to every vertex."""
