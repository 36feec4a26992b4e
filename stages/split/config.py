"""Parameters of split."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.contract import BadInput


@dataclass
class SplitConfig:
    fps: float | None = None
    """Frames kept a second of video, at most; null sets no rate."""
    count: int | None = 120
    """Frames kept in all, at most, spread evenly over the clip; null sets no limit."""
    max_height: int | None = 1280
    """Frames taller than this (px) are scaled down, aspect kept; null keeps the size."""

    def check(self) -> None:
        if self.fps is not None and not 0 < self.fps < float("inf"):
            raise BadInput(f"split.fps is {self.fps}; expected a positive number of frames a second, "
                           "or null for every frame")
        if self.count is not None and self.count < 1:
            raise BadInput(f"split.count is {self.count}; expected at least 1, or null for no limit")
        if self.max_height is not None and self.max_height < 16:
            raise BadInput(f"split.max_height is {self.max_height}; expected at least 16 px, or null to keep the size")
