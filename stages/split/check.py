"""The check of clip.json."""

from __future__ import annotations

from pathlib import Path

from gsac.avatar.artifacts import ArtifactError, Clip


def check_clip(path: Path) -> None:
    """Raises ArtifactError unless the file is a Clip with a positive size and rising timestamps."""
    clip = Clip.read(path)
    if clip.width < 1 or clip.height < 1:
        raise ArtifactError(f"{path}: size {clip.width}x{clip.height}, expected a positive one")
    times = clip.timestamps_s
    if times is None:
        return
    if not times or any(b <= a for a, b in zip(times, times[1:], strict=False)):
        raise ArtifactError(f"{path}: timestamps_s must be a rising list with one entry a frame, or null for photos")
