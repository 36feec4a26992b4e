"""Parameters of split."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.contract import BadInput

NETWORKS = ("pose_detection", "pose_landmark_full")


@dataclass
class SplitConfig:
    fps: float | None = None
    """Most frames kept a second of video; null: no limit."""
    count: int | None = 120
    """Most frames kept in all, spread evenly over the clip; null: no limit."""
    max_height: int | None = 1280
    """Largest height of a frame, px; taller ones are scaled down with their aspect; null keeps the size."""
    photo_fps: float | None = None
    """Frames a second of a folder of photos that were taken out of a video: they have times then, and what is hidden in one is
    filled from its neighbours. Numbers at the ends of the names that rise tell which frames are left out. null: photos."""
    crop: bool = True
    """Whether footage taller than max_height is cut to the person before it is scaled, where that makes the person larger by a
    fifth or more; the frames are whole where it is not sure where the person is."""
    quick: bool = False
    """For a look, as by `gsac check`: frames of a video move by up to a seventh of the time between them to where less has to be
    decoded, to key frames and soon after them, and their files are not compressed."""

    def wishes(self) -> tuple[str, ...]:
        """Names of the network files that find the person: whether they stand, and where."""
        return NETWORKS

    def check(self) -> None:
        if self.fps is not None and not 0 < self.fps < float("inf"):
            raise BadInput(f"split.fps is {self.fps}; expected a positive number of frames a second, "
                           "or null for every frame")
        if self.photo_fps is not None and not 0 < self.photo_fps < float("inf"):
            raise BadInput(f"split.photo_fps is {self.photo_fps}; expected a positive number of frames a second, "
                           "or null for photos without times")
        if self.count is not None and self.count < 1:
            raise BadInput(f"split.count is {self.count}; expected at least 1, or null for no limit")
        if self.max_height is not None and self.max_height < 16:
            raise BadInput(f"split.max_height is {self.max_height}; expected at least 16 px, or null to keep the size")
