"""A fault: where it is born, how strong it is at each severity, and the function that puts it there."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

SEVERITIES = range(6)
"""0: the clean clip."""


class Origin(StrEnum):
    """What a fault's function changes: the take, or the artifact at this port."""

    TAKE = "split"
    """A `Take`: pictures, times and focal length."""
    FILM = "clip"
    """A `Film`: how the take becomes a video file."""
    POINTS = "keypoints/keypoints.npz"
    """Its arrays by name."""
    ALPHA = "segment/alpha"
    """The masks, (T, H, W) float32."""
    BODY = "smplx/body.npz"
    """Its arrays by name; only training sees it."""
    PERSON = "turntable"
    """Options of the turntable, by name: the person behaves or dresses otherwise, and is rendered anew."""


Change = Callable[[Any, float, np.random.Generator], tuple[Any, np.ndarray]]
"""(what `Fault.origin` says, level, random numbers) -> the same changed, and the frames that it touches, (T,) bool."""


@dataclass(frozen=True)
class Fault:
    """One way in which clips go wrong."""

    name: str
    words: str
    """What it is and what its levels mean."""
    levels: tuple[float, float, float, float, float]
    """Of severities 1 to 5."""
    change: Change
    origin: Origin = Origin.TAKE

    def inject(self, clean: Any, severity: int, seed: int) -> tuple[Any, np.ndarray]:
        """clean: what `origin` says. Returns it changed and the frames touched, (T,) bool; at severity 0 clean itself and none."""
        if severity not in SEVERITIES:
            raise ValueError(f"severity is {severity}, expected 0 to {SEVERITIES[-1]}")
        if not severity:
            return clean, np.zeros(0, bool)
        rng = np.random.default_rng([seed, zlib.crc32(self.name.encode())])
        return self.change(clean, self.levels[severity - 1], rng)


def pick_run(frames: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """A run of frames as a mask (frames,) bool: that share of them, at least one, somewhere inside."""
    count = max(1, round(share * frames))
    first = rng.integers(1, max(frames - count, 1) + 1)
    return (np.arange(frames) >= first) & (np.arange(frames) < first + count)


def pick_some(frames: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """Frames as a mask (frames,) bool: that share of them, at least one, anywhere."""
    out = np.zeros(frames, bool)
    out[rng.choice(frames, max(1, min(frames, round(share * frames))), replace=False)] = True
    return out
