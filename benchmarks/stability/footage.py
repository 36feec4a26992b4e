"""Faults of the file: rotation tags, uneven rates, very long clips, 10 bits and HDR, and files of which a part is missing."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gsac.avatar.ffmpeg import ffmpeg_program
from gsac.benchmarks.stability.fault import Fault, Origin, pick_some
from gsac.benchmarks.stability.take import FPS, Take
from gsac.turntable.clip import open_video
from gsac.turntable.options import TurntableOptions

DEEP = (("yuv420p10le", "bt709", "bt709", "bt709"), ("yuv422p10le", "bt709", "bt709", "bt709"),
        ("yuv420p10le", "bt2020-10", "bt2020", "bt2020nc"), ("yuv420p10le", "arib-std-b67", "bt2020", "bt2020nc"),
        ("yuv420p10le", "smpte2084", "bt2020", "bt2020nc"))
"""Kinds of 10-bit files, each farther from a plain one: pixels, transfer, primaries and matrix as the file says them."""


@dataclass(frozen=True)
class Film:
    """How a take becomes a video file."""

    take: Take
    rotation: int = 0
    """Degrees, counterclockwise, by which players turn the stored pictures; the person stands upright after that."""
    gone: tuple[int, ...] = ()
    """Pictures that are missing; the others keep their times."""
    frames: int = 0
    """Length; the take is repeated until then. 0: once."""
    deep: int = 0
    """1 to 5: the kind of 10-bit file in DEEP, whose words about its colours players follow. 0: 8 bits."""
    share: float = 1.0
    """Of the file's bytes, from its beginning."""

    @property
    def plain(self) -> bool:
        """Whether the file itself has no fault."""
        return (self.rotation, self.gone, self.frames, self.deep, self.share) == (0, (), 0, 0, 1.0)

    @property
    def rate(self) -> float:
        """Frames a second."""
        return (len(self.take.times) - 1) / float(np.ptp(self.take.times)) if len(self.take.times) > 1 else FPS

    def write(self, path: Path) -> None:
        """Writes an H.264 file of high quality."""
        stored = [np.rot90(frame, -self.rotation // 90) for frame in self.take.frames]
        height, width = stored[0].shape[:2]
        plain = path.with_suffix(".plain.mp4")
        path.parent.mkdir(parents=True, exist_ok=True)
        with open_video(plain, TurntableOptions(height=height, width=width, fps=self.rate, crf=4)) as video:
            for frame in stored:
                video.add(frame)
        before, after = [], ["-c", "copy"]
        if self.rotation:
            before += ["-display_rotation", str(self.rotation)]
        if self.frames:
            before += ["-stream_loop", "-1"]
            after += ["-frames:v", str(self.frames)]
        if self.gone:
            lost = "+".join(f"eq(n,{n})" for n in self.gone)
            after = ["-vf", f"select='not({lost})'", "-fps_mode", "vfr", "-c:v", "libx264", "-crf", "4"]
        if self.deep:
            pixels, transfer, primaries, matrix = DEEP[self.deep - 1]
            after = ["-c:v", "libx264", "-crf", "4", "-pix_fmt", pixels, "-color_trc", transfer, "-color_primaries", primaries,
                     "-colorspace", matrix]
        subprocess.run([ffmpeg_program(), "-y", "-loglevel", "error", *before, "-i", str(plain), *after, "-movflags", "+faststart",
                        str(path)], check=True, stdin=subprocess.DEVNULL)
        plain.unlink()
        if self.share < 1:
            path.write_bytes(path.read_bytes()[:int(self.share * path.stat().st_size)])

    def number(self, times: np.ndarray) -> np.ndarray:
        """Places (N,) in the take of pictures at these times, (N,) s from the file's beginning."""
        return np.round(times * self.rate).astype(int) % len(self.take.frames)


def turn_file(film: Film, degrees: float, rng: np.random.Generator) -> tuple[Film, np.ndarray]:
    """degrees: of the rotation tag. Returns the film and frames (T,) bool."""
    return replace(film, rotation=int(degrees)), np.ones(len(film.take.frames), bool)


def vary_rate(film: Film, share: float, rng: np.random.Generator) -> tuple[Film, np.ndarray]:
    """share: of the pictures that are missing. Returns the film and frames (T,) bool."""
    gone = pick_some(len(film.take.frames), share, rng)
    gone[0] = False
    return replace(film, gone=tuple(np.flatnonzero(gone).tolist())), np.ones(len(gone), bool)


def repeat(film: Film, frames: float, rng: np.random.Generator) -> tuple[Film, np.ndarray]:
    """frames: of the file. Returns the film and frames (T,) bool."""
    return replace(film, frames=int(frames)), np.ones(len(film.take.frames), bool)


def deepen(film: Film, kind: float, rng: np.random.Generator) -> tuple[Film, np.ndarray]:
    """kind: in DEEP, from 1. Returns the film and frames (T,) bool."""
    return replace(film, deep=int(kind)), np.ones(len(film.take.frames), bool)


def tear(film: Film, share: float, rng: np.random.Generator) -> tuple[Film, np.ndarray]:
    """share: of the file that is there. Returns the film and frames (T,) bool."""
    return replace(film, share=share), np.ones(len(film.take.frames), bool)


FAULTS = (
    Fault("torn-file", "share of the file that is there", (0.95, 0.8, 0.5, 0.2, 0.0), tear, Origin.FILM),
    Fault("rotation-tag", "degrees", (90, 180, 270, 90, 270), turn_file, Origin.FILM),
    Fault("uneven-rate", "share of pictures that are missing, true times", (0.1, 0.2, 0.3, 0.45, 0.6), vary_rate, Origin.FILM),
    Fault("ten-bit", "kind of 10-bit file: 4:2:0, 4:2:2, BT.2020, HLG, PQ", (1, 2, 3, 4, 5), deepen, Origin.FILM),
    Fault("long-clip", "frames of the file", (100, 300, 1000, 3000, 10_000), repeat, Origin.FILM),
)
