"""Runs ffmpeg on one video: the filters it is asked for, what it decodes, and what it says of each frame."""

from __future__ import annotations

import io
import re
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import IO

import numpy as np

from gsac.avatar.artifacts import Crop
from gsac.avatar.ffmpeg import ffmpeg_program
from gsac.avatar.files import told_no_room
from gsac.stages.contract import BadInput, StageError
from gsac.stages.findings import runs_of_frames
from gsac.stages.split.probe import BT2020_MATRIX, BT2020_PRIMARIES, HLG, LIMITS, PQ, UNSPECIFIED, Video, file_url

TRANSFER_NAMES = {HLG: "arib-std-b67", PQ: "smpte2084"}
SHOWN = re.compile(r"\bn:\s*\d+ pts:\s*(-?\d+)")
TIME_BASE = re.compile(r"config in time_base: (\d+)/(\d+)")
SCALING = "lanczos+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact"

Written = tuple[list[int], Fraction, list[str]]
"""Ticks of the frames that came, their time base, and ffmpeg's error lines."""


@dataclass(frozen=True)
class Decoding:
    """What a run of ffmpeg decodes, and how."""

    needed: np.ndarray | None = None
    """(N,) bool, frames to decode; None: all."""
    alone: bool = False
    """By one thread: of a damaged frame several make what the moment makes of it, another picture each time."""


def run_ffmpeg(path: Path, video: Video, output: list[str], folder: Path | None,
               on_frame: Callable[[int], None] = lambda done: None, read: Callable[[IO[bytes]], None] = lambda pictures: None,
               how: Decoding = Decoding()) -> Written:
    """Runs ffmpeg. output: its options for what it writes, of which `showinfo` is a filter; folder: where to, None: nowhere.
    on_frame: called with the number of frames so far; read: reads what it writes to its standard output, to the end.

    Raises BadInput where nothing decodes, StageError where it stops early, an OSError where the disk is full.
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


def read_pictures(stream: IO[bytes], width: int, height: int) -> Iterator[np.ndarray]:
    """Yields (height, width, 3) uint8, to the stream's end."""
    size = 3 * width * height
    while len(data := stream.read(size)) == size:
        yield np.frombuffer(data, np.uint8).reshape(height, width, 3)


def select_frames(ticks: np.ndarray, picks: np.ndarray) -> list[str]:
    """The filter that keeps the frames `picks` (K,) of those at ticks (N,); no filter where all are kept."""
    return [] if len(picks) == len(ticks) else [f"select='{_any_of([f'eq(pts,{tick})' for tick in ticks[picks]])}'"]


def deinterlace(base: Fraction) -> list[str]:
    """Filters that make each frame a picture of one moment by its neighbours, at the time that it had, counted in `base`."""
    return ["bwdif=mode=send_frame:deint=interlaced", f"settb={base}"]


def picture_filters(video: Video, crop: Crop | None, width: int, height: int) -> list[str]:
    """Filters that cut a picture to the crop, scale it to `width` times `height` px and make it SDR without transparency."""
    if crop is not None:
        # In shares: where pixels are not square, the stored width or height is another one.
        share = {name: f"{value}/{whole}" for name, value, whole in zip(
            ("iw", "ih", "x", "y"), (crop.width, crop.height, crop.x, crop.y), (video.width, video.height) * 2, strict=True)}
        cut = f"crop=w=iw*{share['iw']}:h=ih*{share['ih']}:x=iw*{share['x']}:y=ih*{share['y']}:exact=1"
        return [cut, *picture_filters(video, None, width, height)]
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


def _leave_out(sent: np.ndarray, needed: np.ndarray) -> list[str]:
    """Options by which only needed frames are decoded. sent: (N,) ticks, when each is decoded; needed: (N,) bool."""
    order = np.argsort(sent)
    spans = [f"between(dts,{sent[order[first]]},{sent[order[last]]})" for first, last in runs_of_frames(needed[order])]
    return ["-bsf:v", f"noise=drop='not({_any_of(spans)})'"]


def _any_of(terms: list[str]) -> str:
    """A balanced tree: the evaluator recurses."""
    half = len(terms) // 2
    return f"({_any_of(terms[:half])}+{_any_of(terms[half:])})" if half else terms[0]
