"""Entry of split: turns a video file or photos into frames, and checks that frames and clip.json agree."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.stages.contract import BadInput, Job, StageError
from gsac.stages.counting import counted
from gsac.stages.findings import Code, Finding
from gsac.stages.split.config import NETWORKS
from gsac.stages.split.crop import describe_crop
from gsac.stages.split.film import PHOTO_SUFFIXES, find_film, find_videos
from gsac.stages.split.masks import list_masks, match_photos
from gsac.stages.split.people import People
from gsac.stages.split.photos import list_photos, list_plate, split_photos
from gsac.stages.split.video import split_video


def run(job: Job) -> None:
    source = job.inputs["clip"]
    frames = job.out / "frames"
    frames.mkdir()
    masks = list_masks(source)
    film = find_film(source)
    plate, source = (None, source) if film is None else (list_plate(source), film)
    if source.is_dir():
        photos, plate = list_photos(source)
        if videos := find_videos(source):
            left = f"{source.name}/{videos[0].name}"
            job.note(f"{counted(len(photos), 'photo')} of the folder taken, {left} not; give {left} itself to take that")
    elif not source.is_file():
        raise BadInput(f"{source}: no such file or folder")
    elif source.stat().st_size == 0:
        raise BadInput(f"{source.name}: the file is empty; expected a video or a folder of photos.")
    else:
        photos = [source] if source.suffix.lower() in PHOTO_SUFFIXES else []
    people = People(job.models) if all(name in job.models for name in NETWORKS) else None
    if photos:
        fields: dict[str, Any] = split_photos(photos, plate, frames, job.config, people, job.warn, job.progress,
                                              match_photos(masks, photos))
    else:
        fields = split_video(source, frames, job.config, people, job.warn, job.progress, masks, plate)

    # clip.json holds no file name: equal content must give equal bytes.
    clip = Clip(source_sha256=_digest([*(photos or [source]), *([] if plate is None else [plate])]), **fields)
    kept = len(frame_paths(frames))
    if clip.timestamps_s is not None and len(clip.timestamps_s) != kept:
        raise StageError(f"{source.name}: {kept} frames and {len(clip.timestamps_s)} timestamps")
    if kept == 1:
        job.warn(Finding.of(Code.ONE_FRAME, name=source.name))
    if clip.crop is not None:
        job.note(describe_crop(clip.crop))
    clip.write(job.out / "clip.json")


def _digest(files: list[Path]) -> str:
    """sha256 of a file; of several, the sha256 of their sha256s in order."""
    digests = []
    for path in files:
        with open(path, "rb") as f:
            digests.append(hashlib.file_digest(f, "sha256").hexdigest())
    return digests[0] if len(digests) == 1 else hashlib.sha256("\n".join(digests).encode()).hexdigest()
