"""Turns a video file into PNG frames: imageio-ffmpeg's program decodes, rotates, tone-maps and scales."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import Crop
from gsac.stages.contract import BadInput, StageError
from gsac.stages.findings import Code, Finding
from gsac.stages.split import focal
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.crop import principal_point
from gsac.stages.split.ffmpeg_run import TRANSFER_NAMES, Written, run_ffmpeg
from gsac.stages.split.keyframes import read_key_frames
from gsac.stages.split.masks import match_frames, write_masks
from gsac.stages.split.mirrored import find_mirrored, turn_back
from gsac.stages.split.people import People, find_shown
from gsac.stages.split.photos import write_plate_of_video
from gsac.stages.split.pick import fit_size
from gsac.stages.split.picture_quality import Look, judge_pictures
from gsac.stages.split.probe import Video, count_frames, probe
from gsac.stages.split.upright import LARGE_ENOUGH, LOOKS, describe_quarters, find_quarters
from gsac.stages.split.writing import Writing, frame_size, write_one_scene

LONGEST_S = 24 * 3600


def split_video(path: Path, frames: Path, config: SplitConfig, people: People | None, warn: Callable[[Finding], None],
                progress: Callable[[int, int, str], None], masks: Sequence[Path] = (),
                plate: Path | None = None) -> dict:
    """Writes frames/%06d.png, frames/masks/%06d.exr where there are masks, and frames/plate.png where there is a plate. Returns the
    Clip fields fps, timestamps_s, width, height, focal_px, notes, crop, center, repeated.

    people: who finds the person, None: the frames stay whole.
    """
    video, base = read_ticks(path, warn)
    times = (video.ticks - video.ticks[0]) * float(base)
    if not 0 <= times[-1] <= LONGEST_S:
        raise BadInput(f"{path.name}: its frames lie {times[-1]:g} s apart from first to last; at most {LONGEST_S} s are read. "
                       "Copy the file from the phone again, or cut the clip.")
    video = video if people is None else stand_upright(path, video, people, warn)
    writing = Writing(path, video, base, times, frames, config, people, progress)
    picks, crop, written = write_one_scene(video.ticks, times, writing.looks, frames, people, writing.write_scene, warn)
    check_written(path, frames, picks, len(writing.looks), written, warn)
    shown, base, _ = written

    looks, mirrored = treat_mirrored(frames, writing.looks, crop, warn)
    whole, size = (video.width, video.height), frame_size(video, config, crop)
    if masks:
        mask_of = match_frames(masks, len(times), picks)
        write_masks(frames, [mask_of[int(at)] for at in np.searchsorted(video.ticks, shown)], whole, crop, size,
                    mirrored & (crop is None), video.quarters)
    if plate is not None:
        write_plate_of_video(plate, frames, whole, crop, size, video.quarters)
    repeated, findings = judge_pictures(looks, True, None if people is None else partial(find_shown, people, frames))
    if crop is not None:
        repeated |= mirrored
    for finding in findings:
        warn(finding)
    span = float(times[-1])
    as_filmed = size if crop is None else (video.width * crop.scale, video.height * crop.scale)
    return {
        "fps": (len(times) - 1) / span if span > 0 else video.rate,
        "timestamps_s": [float((tick - int(video.ticks[0])) * base) for tick in shown],
        "width": size[0], "height": size[1], "focal_px": focal.from_video_tags(video.tags, *as_filmed),
        "notes": list_changes(video), "crop": crop,
        "center": None if crop is None else principal_point(crop, size, *whole),
        "repeated": np.flatnonzero(repeated).tolist(),
    }


def read_ticks(path: Path, warn: Callable[[Finding], None]) -> tuple[Video, Fraction]:
    """The video with the ticks of its frames, and their time base: a file that does not list them is decoded once. BadInput where
    there is no frame."""
    video = probe(path)
    base = video.time_base
    if not len(video.ticks):
        nowhere = ["-map", f"0:{video.stream}", "-vf", "showinfo=checksum=0", "-f", "null", "-"]
        shown, base, _ = run_ffmpeg(path, video, nowhere, None)
        video.ticks = np.unique(np.array(shown, np.int64))
    if not len(video.ticks):
        raise BadInput(f"{path.name}: holds no frame; record the clip again.")
    if video.declared_frames > len(video.ticks):
        declared, stored = count_frames(path, video)
        if declared > stored:
            warn(Finding.of(Code.VIDEO_TRUNCATED, figure=stored, name=path.name, declared=declared))
    return video, base


def stand_upright(path: Path, video: Video, people: People, warn: Callable[[Finding], None]) -> Video:
    """The video, turned where its person lies on the side."""
    small = fit_size(video.width, video.height, LARGE_ENOUGH)
    quarters = find_quarters(people, read_key_frames(path, video, LOOKS, *small))
    if quarters:
        warn(describe_quarters(quarters))
    return video.turned(quarters)


def check_written(path: Path, frames: Path, picks: np.ndarray, looked_at: int, written: Written,
                  warn: Callable[[Finding], None]) -> None:
    """Raises, or warns, where not all of the frames `picks` (K,) are there. looked_at: number of pictures."""
    shown, _, errors = written
    count = len(list(frames.glob("*.png")))
    if count == 0:
        raise BadInput(f"{path.name}: none of its frames decodes ({errors[0] if errors else 'no reason given'}). "
                       "Copy the file from the phone again.")
    if not count == len(shown) == looked_at:
        raise StageError(f"{path.name}: ffmpeg decoded {len(shown)} frames and wrote {count}; is the disk full?")
    if count < len(picks):
        warn(Finding.of(Code.VIDEO_DAMAGED, figure=len(picks) - count, name=path.name, given=len(picks)))
    elif errors:
        warn(Finding.of(Code.VIDEO_BROKEN, name=path.name, error=errors[0]))


def treat_mirrored(frames: Path, looks: list[Look], crop: Crop | None,
                   warn: Callable[[Finding], None]) -> tuple[list[Look], np.ndarray]:
    """Turns mirrored frames back unless they were cut about the person. Returns the looks at the frames as they are now, and (K,)
    bool, which were mirrored."""
    mirrored = find_mirrored(np.stack([look.blocks for look in looks]))
    if mirrored.any():
        if crop is None:
            turn_back(frames, mirrored)
            looks = [look.turned() if odd else look for look, odd in zip(looks, mirrored, strict=True)]
        warn(Finding.of(Code.MIRRORED, mirrored, figure=mirrored.sum(),
                        treated="turned back" if crop is None else "not used: they were cut to the person's place"))
    return looks, mirrored


def list_changes(video: Video) -> list[str]:
    """What was done to each picture, in words."""
    notes = ["deinterlaced"] if video.interlaced else []
    if video.transfer in TRANSFER_NAMES:
        notes.append(f"tone-mapped from {TRANSFER_NAMES[video.transfer]} to SDR BT.709")
    if video.has_alpha:
        notes.append("transparency composited over black")
    return notes
