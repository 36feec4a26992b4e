"""Turns a video file into PNG frames: imageio-ffmpeg's program decodes, rotates, tone-maps and scales."""

from __future__ import annotations

import contextlib
import io
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import IO

import numpy as np

from gsac.avatar.artifacts import Crop, frame_paths, read_frame
from gsac.avatar.ffmpeg import ffmpeg_program
from gsac.avatar.files import told_no_room
from gsac.stages.contract import BadInput, StageError
from gsac.stages.findings import Code, Finding, runs_of_frames
from gsac.stages.split import focal
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.crop import LEAST_MARGIN, Extent, plan_crop, principal_point, sides_near
from gsac.stages.split.decoding import Chains, find_alone
from gsac.stages.split.keyframes import read_key_frames
from gsac.stages.split.masks import match_frames, write_masks
from gsac.stages.split.mirrored import find_mirrored, turn_back
from gsac.stages.split.people import People, find_extent, find_shown
from gsac.stages.split.photos import write_plate_of_video
from gsac.stages.split.pick import fit_size, pick_by_time, pick_evenly
from gsac.stages.split.picture_quality import HEIGHT, Look, judge_pictures, look_at
from gsac.stages.split.probe import BT2020_MATRIX, BT2020_PRIMARIES, HLG, LIMITS, PQ, UNSPECIFIED, Video, file_url, probe
from gsac.stages.split.scenes import Scene, choose_scene, divide
from gsac.stages.split.upright import FILTERS, LARGE_ENOUGH, LOOKS, describe_quarters, find_quarters

TRANSFER_NAMES = {HLG: "arib-std-b67", PQ: "smpte2084"}
SHOWN = re.compile(r"\bn:\s*\d+ pts:\s*(-?\d+)")
TIME_BASE = re.compile(r"config in time_base: (\d+)/(\d+)")
LONGEST_S = 24 * 3600
SCALING = "lanczos+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact"
COMPRESSION = {False: ("-compression_level", "4", "-pred", "up"), True: ("-compression_level", "0", "-pred", "none")}
"""Of the frames' files, by whether it has to be quick: it takes 80 ms a frame of noise to write, and 15 each time to read."""
PLANS, CHECKS, TRIES = 12, 30, 3
"""Most key frames by which a crop is planned, most frames in which it is checked, and crops tried before the frames stay whole; as
often a scene is cut down to one that may show further cuts, now that its frames lie closer."""


def split_video(path: Path, frames: Path, config: SplitConfig, people: People | None, warn: Callable[[Finding], None],
                progress: Callable[[int, int, str], None], masks: Sequence[Path] = (),
                plate: Path | None = None) -> dict:
    """Writes frames/%06d.png, frames/masks/%06d.exr where there are masks, and frames/plate.png where there is a plate. Returns the
    Clip fields fps, timestamps_s, width, height, focal_px, notes, crop, center, repeated.

    people: who finds the person, None: the frames stay whole.
    """
    video = probe(path)
    base = video.time_base
    if not len(video.ticks):
        shown, base, _ = _run(path, video, ["-map", f"0:{video.stream}", "-vf", "showinfo=checksum=0", "-f", "null", "-"], None)
        video.ticks = np.unique(np.array(shown, np.int64))
    if not len(video.ticks):
        raise BadInput(f"{path.name}: holds no frame; record the clip again.")
    if video.declared_frames > len(video.ticks):
        warn(Finding.of(Code.VIDEO_TRUNCATED, figure=len(video.ticks), name=path.name, declared=video.declared_frames))

    times = (video.ticks - video.ticks[0]) * float(base)
    if not 0 <= times[-1] <= LONGEST_S:
        raise BadInput(f"{path.name}: its frames lie {times[-1]:g} s apart from first to last; at most {LONGEST_S} s are read. "
                       "Copy the file from the phone again, or cut the clip.")
    video = video if people is None else stand_upright(path, video, people, warn)
    looks: list[Look] = []
    chains = Chains.of(video, find_alone(path, video)) if config.quick and not video.interlaced else None
    whole_pictures = _deinterlace(base) if video.interlaced else []

    def write(picks: np.ndarray, crop: Crop | None) -> Written:
        width, height = frame_size(video, config, crop)
        small = fit_size(width, height, HEIGHT)
        graph = ",".join(whole_pictures + _select(video.ticks, picks) + ["showinfo=checksum=0"] + FILTERS[video.quarters]
                         + _picture_filters(video, crop, width, height))
        output = ["-filter_complex", f"[0:{video.stream}]{graph},format=rgb24,split[whole][fine];"
                                     f"[fine]scale={small[0]}:{small[1]}:flags=area+bitexact,format=rgb24[small]",
                  "-map", "[whole]", "-pix_fmt", "rgb24", *COMPRESSION[config.quick], "-flags", "+bitexact",
                  "-start_number", "0", "-fps_mode", "passthrough", "-f", "image2", "%06d.png",
                  "-map", "[small]", "-fps_mode", "passthrough", "-f", "rawvideo", "pipe:1"]

        def decode(how: Decoding) -> Written:
            looks.clear()
            return _run(path, video, output, frames, lambda done: progress(done, len(picks), "frames"),
                        lambda pictures: looks.extend(map(look_at, _read_pictures(pictures, *small))), how)

        return decode_by_need(decode, chains, picks, frames)

    def write_scene(scene: Scene) -> WrittenScene:
        picks = pick_frames(times, scene, config, chains)
        own_keys = video.key_ticks[np.isin(video.key_ticks, video.ticks[scene.first:scene.last + 1])]
        return picks, *write_about_person(path, replace(video, key_ticks=own_keys), frames, config, people, partial(write, picks))

    picks, crop, (shown, base, errors) = write_one_scene(video.ticks, times, looks, frames, people, write_scene, warn)

    written = len(list(frames.glob("*.png")))
    if written == 0:
        raise BadInput(f"{path.name}: none of its frames decodes ({errors[0] if errors else 'no reason given'}). "
                       "Copy the file from the phone again.")
    if not written == len(shown) == len(looks):
        raise StageError(f"{path.name}: ffmpeg decoded {len(shown)} frames and wrote {written}; is the disk full?")
    if written < len(picks):
        warn(Finding.of(Code.VIDEO_DAMAGED, figure=len(picks) - written, name=path.name, given=len(picks)))
    elif errors:
        warn(Finding.of(Code.VIDEO_BROKEN, name=path.name, error=errors[0]))

    mirrored = find_mirrored(np.stack([look.blocks for look in looks]))
    if mirrored.any():
        if crop is None:
            turn_back(frames, mirrored)
            looks = [look.turned() if odd else look for look, odd in zip(looks, mirrored, strict=True)]
        warn(Finding.of(Code.MIRRORED, mirrored, figure=mirrored.sum(),
                        treated="turned back" if crop is None else "not used: they were cut to the person's place"))
    if masks:
        mask_of = match_frames(masks, len(times), picks)
        write_masks(frames, [mask_of[int(at)] for at in np.searchsorted(video.ticks, shown)], (video.width, video.height), crop,
                    frame_size(video, config, crop), mirrored & (crop is None), video.quarters)
    find = None if people is None else partial(find_shown, people, frames)
    repeated, findings = judge_pictures(looks, True, find)
    if crop is not None:
        repeated |= mirrored
    for finding in findings:
        warn(finding)
    notes = ["deinterlaced"] if video.interlaced else []
    if video.transfer in TRANSFER_NAMES:
        notes.append(f"tone-mapped from {TRANSFER_NAMES[video.transfer]} to SDR BT.709")
    if video.has_alpha:
        notes.append("transparency composited over black")
    span = float(times[-1])
    width, height = frame_size(video, config, crop)
    if plate is not None:
        write_plate_of_video(plate, frames, (video.width, video.height), crop, (width, height), video.quarters)
    whole_width, whole_height = (width, height) if crop is None else (video.width * crop.scale, video.height * crop.scale)
    return {
        "fps": (len(times) - 1) / span if span > 0 else video.rate,
        "timestamps_s": [float((tick - int(video.ticks[0])) * base) for tick in shown],
        "width": width, "height": height, "focal_px": focal.from_video_tags(video.tags, whole_width, whole_height),
        "notes": notes, "crop": crop,
        "center": None if crop is None else principal_point(crop, (width, height), video.width, video.height),
        "repeated": np.flatnonzero(repeated).tolist(),
    }


def stand_upright(path: Path, video: Video, people: People, warn: Callable[[Finding], None]) -> Video:
    """The video, turned where its person lies on the side."""
    small = fit_size(video.width, video.height, LARGE_ENOUGH)
    quarters = find_quarters(people, read_key_frames(path, video, LOOKS, *small))
    if quarters:
        warn(describe_quarters(quarters))
    return video.turned(quarters)


def frame_size(video: Video, config: SplitConfig, crop: Crop | None) -> tuple[int, int]:
    """Width and height of the frames, px."""
    return fit_size(*(video.width, video.height) if crop is None else (crop.width, crop.height), config.max_height)


Written = tuple[list[int], Fraction, list[str]]
WrittenScene = tuple[np.ndarray, Crop | None, Written]
"""The frames that were picked, (K,) of the video's, how they were cut, and what became of them."""


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


def pick_frames(times: np.ndarray, scene: Scene, config: SplitConfig, chains: Chains | None) -> np.ndarray:
    """The frames of a scene that are kept, (K,). times: (N,) s, of the video's frames; chains: theirs, where it has to be quick."""
    picks = scene.first + pick_by_time(times[scene.first:scene.last + 1], config.fps, config.count)
    return picks if chains is None else chains.move_picks(picks, times)


@dataclass(frozen=True)
class Decoding:
    """What a run of ffmpeg decodes, and how."""

    needed: np.ndarray | None = None
    """(N,) bool, frames to decode; None: all."""
    alone: bool = False
    """By one thread: of a damaged frame several make what the moment makes of it, another picture each time."""


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


def _select(ticks: np.ndarray, picks: np.ndarray) -> list[str]:
    """The filter that keeps the picked presentation times; no filter where all are kept."""
    return [] if len(picks) == len(ticks) else [f"select='{_any_of([f'eq(pts,{tick})' for tick in ticks[picks]])}'"]


def _deinterlace(base: Fraction) -> list[str]:
    """Filters that make each frame a picture of one moment by its neighbours, at the time that it had, counted in `base`."""
    return ["bwdif=mode=send_frame:deint=interlaced", f"settb={base}"]


def _leave_out(sent: np.ndarray, needed: np.ndarray) -> list[str]:
    """Options by which only needed frames are decoded. sent: (N,) ticks, when each is decoded; needed: (N,) bool."""
    order = np.argsort(sent)
    spans = [f"between(dts,{sent[order[first]]},{sent[order[last]]})" for first, last in runs_of_frames(needed[order])]
    return ["-bsf:v", f"noise=drop='not({_any_of(spans)})'"]


def _any_of(terms: list[str]) -> str:
    """A balanced tree: the evaluator recurses."""
    half = len(terms) // 2
    return f"({_any_of(terms[:half])}+{_any_of(terms[half:])})" if half else terms[0]


def _picture_filters(video: Video, crop: Crop | None, width: int, height: int) -> list[str]:
    if crop is not None:
        # In shares: where pixels are not square, the stored width or height is another one.
        share = {name: f"{value}/{whole}" for name, value, whole in zip(
            ("iw", "ih", "x", "y"), (crop.width, crop.height, crop.x, crop.y), (video.width, video.height) * 2, strict=True)}
        cut = f"crop=w=iw*{share['iw']}:h=ih*{share['ih']}:x=iw*{share['x']}:y=ih*{share['y']}:exact=1"
        return [cut, *_picture_filters(video, None, width, height)]
    scale = f"scale={width}:{height}:flags={SCALING}"
    if video.transfer in TRANSFER_NAMES:
        source = f"tin={TRANSFER_NAMES[video.transfer]}"
        if video.primaries == UNSPECIFIED:
            source += f":pin={BT2020_PRIMARIES}"
        if video.matrix == UNSPECIFIED:
            source += f":min={BT2020_MATRIX}"
        # 203 nits is BT.2408's diffuse white: it lands near the top of SDR and only highlights above it are bent.
        return [scale, f"zscale=t=linear:npl=203:{source}", "format=gbrpf32le", "zscale=p=bt709",
                "tonemap=mobius:param=0.7:desat=0", "zscale=t=bt709:d=none", "format=gbrp"]
    if video.has_alpha:
        return ["format=gbrap", "premultiply=inplace=1", f"scale={width}:{height}:flags={SCALING}", "format=gbrp"]
    return [scale]


def _run(path: Path, video: Video, output: list[str], folder: Path | None, on_frame: Callable[[int], None] = lambda done: None,
         read: Callable[[IO[bytes]], None] = lambda pictures: None, how: Decoding = Decoding()) -> Written:
    """Runs ffmpeg. read: reads what it writes to its output, to the end.

    Returns the ticks of the frames that passed `showinfo`, their time base, and its error lines.
    """
    decoder = [*(["-threads", "1"] if how.alone else []), *(["-c:v", video.decoder] if video.decoder else [])]
    limits = [word for name, value in LIMITS.items() for word in (f"-{name}", value)]
    left_out = _leave_out(video.sent, how.needed) if how.needed is not None else []
    command = [ffmpeg_program(), "-nostdin", "-hide_banner", "-loglevel", "level+info", "-copyts",
               "-max_error_rate", "1", "-fflags", "+discardcorrupt", *limits, *decoder, *left_out, "-i", file_url(path), *output]
    ticks: list[int] = []
    base, errors = video.time_base, []
    # The output pattern is relative to `folder`: a % in the folder's own name is no pattern.
    with (ThreadPoolExecutor(1) as reader, subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                                            stderr=subprocess.PIPE) as process):
        assert process.stdout is not None and process.stderr is not None
        reading = reader.submit(read, process.stdout)
        try:
            for line in io.TextIOWrapper(process.stderr, errors="replace"):
                if found := SHOWN.search(line):
                    ticks.append(int(found[1]))
                    on_frame(len(ticks))
                elif found := TIME_BASE.search(line):
                    base = Fraction(int(found[1]), int(found[2]))
                elif "[error]" in line or "[fatal]" in line:
                    errors.append(line.strip())
            reading.result()
        except BaseException:
            process.kill()
            raise
    if folder is not None and (full := told_no_room(" ".join(errors), folder)):
        raise full
    why = errors[-1] if errors else f"exit code {process.returncode}"
    if process.returncode != 0 and not ticks:
        raise BadInput(f"{path.name}: ffmpeg cannot decode it ({why}).")
    if process.returncode != 0:
        raise StageError(f"{path.name}: ffmpeg stopped after {len(ticks)} frames ({why}).")
    return ticks, base, errors


def _read_pictures(stream: IO[bytes], width: int, height: int) -> Iterator[np.ndarray]:
    """Yields (height, width, 3) uint8, to the stream's end."""
    size = 3 * width * height
    while len(data := stream.read(size)) == size:
        yield np.frombuffer(data, np.uint8).reshape(height, width, 3)
