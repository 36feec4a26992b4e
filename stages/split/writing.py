"""Writes a scene of a video as frames: which ones, cut about the person, decoded by as little as they need."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import Crop, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.contract import StageError
from gsac.stages.findings import Code, Finding
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.crop import LEAST_MARGIN, Extent, plan_crop, sides_near
from gsac.stages.split.decoding import Chains, find_alone
from gsac.stages.split.ffmpeg_run import (
    Decoding,
    Written,
    deinterlace,
    picture_filters,
    read_pictures,
    run_ffmpeg,
    select_frames,
)
from gsac.stages.split.keyframes import read_key_frames
from gsac.stages.split.people import People, find_extent
from gsac.stages.split.pick import fit_size, pick_by_time, pick_evenly
from gsac.stages.split.picture_quality import HEIGHT, Look, look_at
from gsac.stages.split.probe import Video
from gsac.stages.split.scenes import Scene, choose_scene, divide
from gsac.stages.split.upright import FILTERS

COMPRESSION = {False: ("-compression_level", "4", "-pred", "up"), True: ("-compression_level", "0", "-pred", "none")}
"""Of the frames' files, by whether it has to be quick: it takes 80 ms a frame of noise to write, and 15 each time to read."""
PLANS, CHECKS, TRIES = 12, 30, 3
"""Most key frames by which a crop is planned, most frames in which it is checked, and crops tried before the frames stay whole; as
often a scene is cut down to one that may show further cuts, now that its frames lie closer."""

WrittenScene = tuple[np.ndarray, Crop | None, Written]
"""The frames that were picked, (K,) of the video's, how they were cut, and what became of them."""


class Writing:
    """Writes pictures of a video as frames, and looks at each on the way."""

    def __init__(self, path: Path, video: Video, base: Fraction, times: np.ndarray, frames: Path, config: SplitConfig,
                 people: People | None, progress: Callable[[int, int, str], None]):
        """base: s a tick; times: (N,) s, of the video's frames; frames: folder that they are written to."""
        self.path, self.video, self.times, self.frames = path, video, times, frames
        self.config, self.people, self.progress = config, people, progress
        self.chains = Chains.of(video, find_alone(path, video)) if config.quick and not video.interlaced else None
        self.whole_pictures = deinterlace(base) if video.interlaced else []
        self.looks: list[Look] = []
        """At the frames that were written last."""

    def write_scene(self, scene: Scene) -> WrittenScene:
        """Writes frames of a scene, about its person."""
        picks = pick_frames(self.times, scene, self.config, self.chains)
        ticks = self.video.ticks[scene.first:scene.last + 1]
        own_keys = self.video.key_ticks[np.isin(self.video.key_ticks, ticks)]
        video = replace(self.video, ticks=ticks, key_ticks=own_keys)
        return picks, *write_about_person(self.path, video, self.frames, self.config, self.people, partial(self.write, picks))

    def write(self, picks: np.ndarray, crop: Crop | None) -> Written:
        """Writes the frames `picks` (K,), cut to the crop."""
        video = self.video
        width, height = frame_size(video, self.config, crop)
        small = fit_size(width, height, HEIGHT)
        graph = ",".join(self.whole_pictures + select_frames(video.ticks, picks) + ["showinfo=checksum=0"] + FILTERS[video.quarters]
                         + picture_filters(video, crop, width, height))
        output = ["-filter_complex", f"[0:{video.stream}]{graph},format=rgb24,split[whole][fine];"
                                     f"[fine]scale={small[0]}:{small[1]}:flags=area+bitexact,format=rgb24[small]",
                  "-map", "[whole]", "-pix_fmt", "rgb24", *COMPRESSION[self.config.quick], "-flags", "+bitexact",
                  "-start_number", "0", "-fps_mode", "passthrough", "-f", "image2", "%06d.png",
                  "-map", "[small]", "-fps_mode", "passthrough", "-f", "rawvideo", "pipe:1"]
        return decode_by_need(partial(self._decode, output, len(picks), small), self.chains, picks, self.frames)

    def _decode(self, output: list[str], count: int, small: tuple[int, int], how: Decoding) -> Written:
        """Runs ffmpeg for `count` frames. small: width and height of the pictures that are looked at, px."""
        self.looks.clear()
        return run_ffmpeg(self.path, self.video, output, self.frames, lambda done: self.progress(done, count, "frames"),
                    lambda pictures: self.looks.extend(map(look_at, read_pictures(pictures, *small))), how)


def write_one_scene(ticks: np.ndarray, times: np.ndarray, looks: list[Look], frames: Path, people: People | None,
                    write_scene: Callable[[Scene], WrittenScene], warn: Callable[[Finding], None]) -> WrittenScene:
    """Writes the frames of the whole video, and of one scene alone where it is cut together of several.

    ticks, times: (N,) of the video's frames; looks: at the frames that were written last.
    """
    scene, scenes = Scene(0, len(times) - 1), 1
    found = write_scene(scene)
    for _ in range(TRIES):
        parts = divide(scene, np.searchsorted(ticks, found[2][0]), [look.blocks for look in looks])
        if len(parts) == 1:
            break
        scene, scenes = choose_scene(parts, times, frame_paths(frames), people), scenes + len(parts) - 1
        remove_frames(frames)
        found = write_scene(scene)
    if scenes > 1:
        warn(Finding.of(Code.SCENES_LEFT_OUT, figure=scenes, first=times[scene.first], last=times[scene.last]))
    return found


def write_about_person(path: Path, video: Video, frames: Path, config: SplitConfig, people: People | None,
                       write: Callable[[Crop | None], Written]) -> tuple[Crop | None, Written]:
    """Writes the frames, cut where the key frames say that it is worth while; and again, wider or whole, where the frames show that
    it cuts the person."""
    if people is None or not config.crop or config.max_height is None or video.height <= config.max_height:
        return None, write(None)
    whole = video.width, video.height, config.max_height
    looks = read_key_frames(path, video, PLANS, *frame_size(video, config, None))
    extent = find_extent(people, looks, *whole)
    for _ in range(TRIES):
        crop = plan_crop(extent, *whole) if extent is not None else None
        if crop is None:
            break
        written = write(crop)
        found = see_frames(people, frames, crop)
        if found is not None and not sides_near(found, crop, *whole[:2], LEAST_MARGIN).any():
            return crop, written
        extent = found.joined(extent).grown(sides_near(found, crop, *whole[:2], 0)) if found is not None else None
        remove_frames(frames)
    return None, write(None)


def frame_size(video: Video, config: SplitConfig, crop: Crop | None) -> tuple[int, int]:
    """Width and height of the frames, px."""
    return fit_size(*(video.width, video.height) if crop is None else (crop.width, crop.height), config.max_height)


def pick_frames(times: np.ndarray, scene: Scene, config: SplitConfig, chains: Chains | None) -> np.ndarray:
    """The frames of a scene that are kept, (K,). times: (N,) s, of the video's frames; chains: theirs, where it has to be quick."""
    picks = scene.first + pick_by_time(times[scene.first:scene.last + 1], config.fps, config.count)
    return picks if chains is None else chains.move_picks(picks, times)


def decode_by_need(decode: Callable[[Decoding], Written], chains: Chains | None, picks: np.ndarray, frames: Path) -> Written:
    """Writes the frames `picks` (K,): by what they need alone where `chains` tells it, by all of the video where that fails, and by
    one thread where something is damaged, so that the same video always gives the same frames."""
    if chains is not None:
        with contextlib.suppress(StageError):  # programs older than 7.1 cannot
            written = decode(Decoding(chains.needed(picks)))
            if is_sound(written, picks):
                return written
        remove_frames(frames)
    written = decode(Decoding())
    if not is_sound(written, picks):
        remove_frames(frames)
        written = decode(Decoding(alone=True))
    return written


def is_sound(written: Written, picks: np.ndarray) -> bool:
    """Whether all frames `picks` (K,) came without an error."""
    ticks, _, errors = written
    return len(ticks) == len(picks) and not errors


def remove_frames(folder: Path) -> None:
    """Makes room for other ones."""
    for frame in frame_paths(folder):
        frame.unlink()


def see_frames(people: People, frames: Path, crop: Crop) -> Extent | None:
    """Where the person is in the frames, px of the footage; None where that is not known."""
    people.start_anew()
    paths, found = frame_paths(frames), None
    for i in pick_evenly(len(paths), CHECKS):
        seen = people.follow(read_frame(paths[i]))
        found = seen.mapped(1 / crop.scale, crop.x, crop.y).joined(found) if seen is not None else found
    return found if people.known else None
