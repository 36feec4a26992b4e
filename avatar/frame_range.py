"""The frames that an artifact speaks of: how many they are, and the artifact of the first of them alone."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from gsac.avatar.artifacts import PER_FRAME, Clip, frame_paths, read_arrays, write_arrays

CLIP_FILE = "clip.json"


def count_frames(path: Path) -> int | None:
    """Frames that an artifact speaks of; None of one that does not tell."""
    if path.is_dir():
        return len(frame_paths(path)) or None
    if path.suffix == ".npz":
        return next((len(array) for name, array in read_arrays(path).items() if name in PER_FRAME), None)
    times = Clip.read(path).timestamps_s if path.name == CLIP_FILE else None
    return None if times is None else len(times)


def copy_frames(source: Path, target: Path, frames: int | None = None) -> None:
    """Copies an artifact as real files that may be written to. frames: keep the first so many only, None: all.

    What is no frame and what is not by frames is copied whole.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        left_out = slice(frames, None) if frames is not None else slice(0, 0)
        shutil.copytree(source, target, copy_function=shutil.copyfile,
                        ignore=lambda folder, names: [path.name for path in frame_paths(Path(folder))[left_out]])
    elif frames is not None and target.suffix == ".npz":
        arrays = {name: array[:frames] if name in PER_FRAME else array for name, array in read_arrays(source).items()}
        write_arrays(target, **arrays)
    elif frames is not None and target.name == CLIP_FILE:
        clip = Clip.read(source)
        times = clip.timestamps_s and clip.timestamps_s[:frames]
        replace(clip, timestamps_s=times, repeated=[t for t in clip.repeated if t < frames]).write(target)
    else:
        shutil.copyfile(source, target)
