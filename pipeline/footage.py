"""How many frames of what size a run works on, told without decoding: from split's result, else from the clip's own header."""

from __future__ import annotations

import contextlib
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gsac.stages.split.film import find_film, find_photos

HEADER_BYTES = 64 << 20
"""Largest header of a video that is read."""
LIKELY_FRAMES, LIKELY_HEIGHT = 120, 1280
"""Of a clip that tells nothing and parameters without limits."""
PHOTO_ASPECT, VIDEO_ASPECT = 3 / 4, 9 / 16
"""Width over height where nothing is known: upright."""


@dataclass(frozen=True)
class Footage:
    """The frames that stages work on."""

    frames: int
    width: int
    height: int
    read: bool = True
    """Whether files told all of it; else it is what the parameters allow."""

    @property
    def megapixels(self) -> float:
        """Of one frame."""
        return self.width * self.height / 1e6

    @property
    def square(self) -> float:
        """Megapixels of a square as high as a frame: what a standing person spans, whatever the frame's width."""
        return self.height ** 2 / 1e6


def footage_of_result(frames: Path | None, clip: Path | None) -> Footage | None:
    """Of what split has made: its folder `frames` and its `clip.json`, of which one may be missing. None where they do not tell."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, struct.error):
        told = json.loads(clip.read_text()) if clip is not None else {}
        names = sorted(path.name for path in frames.glob("[0-9]*.png")) if frames is not None else []
        count = len(names) if frames is not None else len(told["timestamps_s"])
        width, height = (told["width"], told["height"]) if told or frames is None else _png_size(frames / names[0])
        return Footage(count, int(width), int(height)) if count else None
    return None


def expect_footage(clip: Path, split: Any) -> Footage:
    """What split will keep of a clip: a video, a folder of photos, or one with a video.

    split: its config, or None.
    """
    clip = find_film(clip) or clip
    fps, count, most = (getattr(split, name, None) for name in ("fps", "count", "max_height"))
    height = most or LIKELY_HEIGHT
    if clip.is_dir():
        return keep(Footage(max(1, len(find_photos(clip))), round(height * PHOTO_ASPECT), height, read=False), count, most)
    header = read_header(clip)
    if header is None:
        return Footage(count or LIKELY_FRAMES, round(height * VIDEO_ASPECT), height, read=False)
    frames = header.frames if fps is None else min(header.frames, int(header.seconds * fps) + 1)
    return keep(Footage(frames, header.width, header.height), count, most)


def keep(footage: Footage, count: int | None, max_height: int | None) -> Footage:
    """What is left of frames by split's parameters of these names."""
    height = min(footage.height, max_height or footage.height)
    width = max(1, round(footage.width * height / footage.height))
    return replace(footage, frames=min(footage.frames, count or footage.frames), width=width, height=height)


@dataclass(frozen=True)
class Header:
    """What the header of a video says of its pictures."""

    frames: int
    seconds: float
    width: int
    height: int
    """px, as shown: turned by the file's own matrix."""


def read_header(clip: Path) -> Header | None:
    """Of an MP4 or QuickTime file, as phones write them (ISO/IEC 14496-12); None of any other, and of a damaged one."""
    with contextlib.suppress(OSError, ValueError, struct.error, ZeroDivisionError):
        found = [header for track in _inside(_movie(clip), b"trak") if (header := _track(track)) is not None]
        return max(found, key=lambda header: header.width * header.height, default=None)
    return None


def _movie(clip: Path) -> bytes:
    """Content of the box `moov`; empty without one."""
    with clip.open("rb") as file:
        end, at = file.seek(0, 2), 0
        while at + 8 <= end:
            file.seek(at)
            size, kind = struct.unpack(">I4s", file.read(8))
            head = 8
            if size == 1:
                size, head = struct.unpack(">Q", file.read(8))[0], 16
            if kind == b"moov" or size < head:
                return file.read(size - head) if kind == b"moov" and head <= size <= HEADER_BYTES else b""
            at += size
    return b""


def _inside(content: bytes, *path: bytes) -> Iterator[bytes]:
    """Contents of the boxes at a path of kinds."""
    at = 0
    while at + 8 <= len(content):
        size, kind = struct.unpack_from(">I4s", content, at)
        if size < 8:
            return
        if kind == path[0]:
            below = content[at + 8:at + size]
            yield from _inside(below, *path[1:]) if path[1:] else (below,)
        at += size


def _track(track: bytes) -> Header | None:
    """Of a track of pictures; None of any other, and where the frames are not listed."""
    if next(_inside(track, b"mdia", b"hdlr"), b"")[8:12] != b"vide":
        return None
    head, media = next(_inside(track, b"tkhd"), b""), next(_inside(track, b"mdia", b"mdhd"), b"")
    sizes = next(_inside(track, b"mdia", b"minf", b"stbl", b"stsz"), b"")
    a, b = struct.unpack(">2i", head[-44:-36])  # the first row of the matrix, before width and height
    width, height = (side / 65536 for side in struct.unpack(">2I", head[-8:]))
    scale, length = struct.unpack(">IQ", media[20:32]) if media[0:1] == b"\1" else struct.unpack(">2I", media[12:20])
    frames, = struct.unpack(">I", sizes[8:12])
    if a == 0 and b != 0:
        width, height = height, width
    return Header(frames, length / scale, round(width), round(height)) if frames and round(width) and round(height) else None


def _png_size(file: Path) -> tuple[int, int]:
    with file.open("rb") as opened:
        return struct.unpack(">2I", opened.read(24)[16:24])
