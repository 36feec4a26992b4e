"""Reads Biovision BVH files. Every error names the file and the line."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gsac.avatar.motion import quat
from gsac.avatar.motion.source import LARGEST, MAX_BYTES, MotionError, Source, most_frames, too_long

MAX_LINE = 1 << 20
"""Characters."""
MAX_JOINTS = 1000
MAX_DEPTH = 200
AXES = "XYZ"
CHANNELS = {f"{axis}{kind}".lower(): (kind, i) for kind in ("position", "rotation") for i, axis in enumerate(AXES)}


def read_bvh(path: Path) -> Source:
    """The motion of a BVH file. Rest: all rotations zero. Raises MotionError."""
    size = Path(path).stat().st_size
    if size > MAX_BYTES:
        raise MotionError(f"{path}: it has {size} bytes, at most {MAX_BYTES} are read")
    with open(path, encoding="utf-8", errors="replace") as file:
        return _Reader(file, str(path)).source()


class _Reader:
    """Joints in the order of the file, then the table of numbers; one line of it is in memory at a time."""

    def __init__(self, file: io.TextIOBase, where: str) -> None:
        self.file, self.where, self.line = file, where, 0
        self.words = self.read_words()
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.channels: list[list[tuple[str, int]]] = []

    def bad(self, why: str) -> MotionError:
        return MotionError(f"{self.where}, line {self.line}: {why}")

    def read_lines(self) -> Iterator[str]:
        while line := self.file.readline(MAX_LINE):
            self.line += 1
            if len(line) == MAX_LINE:
                raise self.bad(f"a line of more than {MAX_LINE} characters")
            yield line

    def read_words(self) -> Iterator[str]:
        for line in self.read_lines():
            yield from line.split()

    def word(self, *wanted: str) -> str:
        """The next word; with `wanted`, one of them in any case."""
        found = next(self.words, None)
        if found is None:
            raise self.bad(f"the file ends where {' or '.join(wanted) or 'more'} is expected")
        if wanted and found.lower() not in [w.lower() for w in wanted]:
            raise self.bad(f"{found[:40]!r} stands where {' or '.join(wanted)} is expected")
        return found

    def number(self, most: float = LARGEST) -> float:
        word = self.word()
        try:
            value = float(word)
        except ValueError:
            raise self.bad(f"{word[:40]!r} stands where a number is expected") from None
        if not np.isfinite(value) or abs(value) > most:
            raise self.bad(f"{word[:40]!r} is not a finite number, or is beyond {most:g}")
        return value

    def source(self) -> Source:
        self.word("HIERARCHY")
        self.word("ROOT")
        self.joint(-1, 0)
        if self.word("MOTION", "ROOT").lower() == "root":
            raise self.bad("a second ROOT; files with one skeleton are read")
        self.word("Frames:")
        frames = self.number(np.inf)
        if frames < 1 or frames != int(frames):
            raise self.bad(f"{frames:g} frames; at least one is expected")
        self.word("Frame")
        self.word("Time:")
        seconds = self.number()
        if not 1e-4 <= seconds <= 10:
            raise self.bad(f"a frame time of {seconds:g} s; 0.0001 to 10 is expected")
        return self.posed(self.table(int(frames)), 1 / seconds)

    def joint(self, parent: int, depth: int) -> None:
        """A joint after its keyword, with all below it."""
        if len(self.names) >= MAX_JOINTS or depth > MAX_DEPTH:
            raise self.bad(f"more than {MAX_JOINTS} joints or {MAX_DEPTH} generations")
        words = []
        while (word := self.word()) != "{":
            words.append(word)
        if not words:
            raise self.bad("a joint without a name")
        at = len(self.names)
        self.names.append(" ".join(words))
        self.parents.append(parent)
        self.offsets.append([0.0, 0.0, 0.0])
        self.channels.append([])
        while (word := self.word("OFFSET", "CHANNELS", "JOINT", "End", "}")) != "}":
            if word.lower() == "offset":
                self.offsets[at] = [self.number() for _ in AXES]
            elif word.lower() == "channels":
                self.channels[at] = [self.channel() for _ in range(self.count())]
            elif word.lower() == "joint":
                self.joint(at, depth + 1)
            else:
                for part in ("Site", "{", "OFFSET"):
                    self.word(part)
                for _ in AXES:
                    self.number()
                self.word("}")

    def count(self) -> int:
        n = self.number()
        if n not in range(7):
            raise self.bad(f"{n:g} channels; 0 to 6 are expected")
        return int(n)

    def channel(self) -> tuple[str, int]:
        word = self.word()
        if word.lower() not in CHANNELS:
            raise self.bad(f"{word[:40]!r} is not a channel; they are Xposition ... Zrotation")
        return CHANNELS[word.lower()]

    def table(self, frames: int) -> np.ndarray:
        """(T, all channels); one line a frame."""
        width = sum(map(len, self.channels))
        most = most_frames(len(self.names))
        out, k = np.empty((min(frames, most), width)), 0
        for row in self.read_lines():
            values = row.split()
            if not values:
                continue
            if k >= frames:
                raise self.bad(f"a frame more than the {frames} that the file says")
            if k >= most:
                raise self.bad(too_long(frames, len(self.names)))
            if len(values) != width:
                raise self.bad(f"{len(values)} numbers; the skeleton has {width} channels")
            try:
                out[k] = values
            except ValueError:
                raise self.bad("something other than numbers") from None
            if not (np.abs(out[k]) <= LARGEST).all():
                raise self.bad(f"a number that is not finite, or beyond {LARGEST:g}")
            k += 1
        if k < frames:
            raise self.bad(f"the file ends after {k} of {frames} frames; was it cut off?")
        return out

    def posed(self, table: np.ndarray, fps: float) -> Source:
        """Turns and places in the world, joint by joint."""
        P, T = len(self.names), len(table)
        turns, places = np.empty((T, P, 4)), np.empty((T, P, 3))
        rest = np.zeros((P, 3))
        first = 0
        for j, parent in enumerate(self.parents):
            local, turn = np.tile(np.array(self.offsets[j]), (T, 1)), np.tile(quat.IDENTITY, (T, 1))
            for column, (kind, axis) in enumerate(self.channels[j], first):
                if kind == "position":
                    local[:, axis] = table[:, column]
                else:
                    half = np.radians(table[:, column]) / 2
                    step = np.zeros((T, 4))
                    step[:, axis], step[:, 3] = np.sin(half), np.cos(half)
                    turn = quat.multiply(turn, step)
            first += len(self.channels[j])
            if parent < 0:
                turns[:, j], places[:, j], rest[j] = turn, local, self.offsets[j]
            else:
                turns[:, j] = quat.multiply(turns[:, parent], turn)
                places[:, j] = places[:, parent] + quat.rotate(turns[:, parent], local)
                rest[j] = rest[parent] + self.offsets[j]
        return Source(fps, self.names, np.array(self.parents), np.tile(quat.IDENTITY, (P, 1)), rest, turns, places)
