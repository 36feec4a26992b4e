"""events.jsonl in the folder of a run or a batch: all that was told there, a JSON line an event.

A line is appended whole by one write. What a kill cut off is no event to a reader, and the next writer begins a new line. Where
the file has grown to LIMIT it becomes events.1.jsonl, in place of the one before.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO

from gsac.pipeline.events import Event, StageProgress, read_event
from gsac.pipeline.journal import Journal
from gsac.pipeline.placing import keep_aside
from gsac.pipeline.run_folder import EVENTS, OLDER_EVENTS, RunFolder
from gsac.stages.contract import BadInput

LIMIT = 8 << 20
"""Bytes of either file."""
BEGIN = b'{"event":"'
"""Tells a file from one of the user's by the same name."""
PROGRESS_GAP_S = 5.0
"""At least this long between two progress events of a stage that are kept, unless its unit is another."""
LOOK_S = 0.2
"""Between two looks at a file that is followed."""


class EventFile(AbstractContextManager):
    """Appends what is told to the file of a folder. A disk that takes no more ends the file, never the run."""

    def __init__(self, folder: Path, leave_out: Collection[type[Event]] = (), limit: int = LIMIT):
        """leave_out: kinds that are not kept; limit: bytes. The files must not be another's: see `others_files`."""
        self._path, self._leave_out, self._limit = folder / EVENTS, tuple(leave_out), limit
        self._descriptor = -1
        self._progress: StageProgress | None = None
        try:
            self._open()
        except OSError:
            self.close()

    def __exit__(self, *exc) -> None:
        self.close()

    def close(self) -> None:
        """Nothing is kept any more."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def take(self, event: Event) -> None:
        """Appends the event."""
        if self._descriptor < 0 or isinstance(event, self._leave_out) or self._too_soon(event):
            return
        line = event.to_line().encode()
        try:
            if os.fstat(self._descriptor).st_size + len(line) > self._limit:
                self.close()
                os.replace(self._path, self._path.with_name(OLDER_EVENTS))
                self._open()
            if os.write(self._descriptor, line) < len(line):
                self.close()
        except OSError:
            self.close()

    def _open(self) -> None:
        self._descriptor = os.open(self._path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        size = os.fstat(self._descriptor).st_size
        if size and os.pread(self._descriptor, 1, size - 1) != b"\n":  # a kill cut the last line off
            os.write(self._descriptor, b"\n")

    def _too_soon(self, event: Event) -> bool:
        if not isinstance(event, StageProgress):
            return False
        last = self._progress
        if last is not None and (last.stage, last.unit) == (event.stage, event.unit) and event.time - last.time < PROGRESS_GAP_S:
            return True
        self._progress = event
        return False


@contextlib.contextmanager
def kept_events(folder: RunFolder, journal: Journal) -> Iterator[None]:
    """What is told meanwhile is appended to the file of a run's folder; a file of the user's by its name is moved aside."""
    for path in others_files(folder.root):
        keep_aside(path, folder.say)
    with EventFile(folder.root) as file, journal.heard_by(file.take):
        yield


def others_files(folder: Path) -> list[Path]:
    """What has the names of the files of events in a folder and is not of gsac's making."""
    return [path for name in (EVENTS, OLDER_EVENTS) if os.path.lexists(path := folder / name) and not _is_ours(path)]


def _is_ours(path: Path) -> bool:
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as stream:
        begin = stream.read(len(BEGIN))
    return begin == BEGIN[:len(begin)]


def require_events(folder: Path) -> None:
    """BadInput where nothing was told in a folder yet."""
    if not (folder / EVENTS).is_file() or not _is_ours(folder / EVENTS):
        raise BadInput(f"{folder} holds no {EVENTS} of gsac's; give the folder of a run or of a batch")


def read_events(folder: Path) -> Iterator[Event]:
    """All events that are kept in a folder, oldest first."""
    for path in (folder / OLDER_EVENTS, folder / EVENTS):
        if path.is_file() and _is_ours(path):
            with path.open("rb") as stream:
                yield from _read_on(stream)


def follow_events(folder: Path, until: Callable[[Event], bool], sleep: Callable[[float], None] = time.sleep) -> Iterator[Event]:
    """The same, then those to come, up to the first that is `until` and that no other follows yet."""
    if (folder / OLDER_EVENTS).is_file() and _is_ours(folder / OLDER_EVENTS):
        with (folder / OLDER_EVENTS).open("rb") as stream:
            yield from _read_on(stream)
    ended = False
    while True:
        with (folder / EVENTS).open("rb") as stream:
            at_hand = True
            while at_hand:
                at_hand = _is_at(stream, folder / EVENTS)  # asked before the last reading: what is moved away is read to its end
                for event in _read_on(stream):
                    ended = until(event)
                    yield event
                if ended:
                    return
                if at_hand:
                    sleep(LOOK_S)


def _read_on(stream: BinaryIO) -> Iterator[Event]:
    """Events of the whole lines that are there from here on; stops before a line without its end."""
    while (line := stream.readline()).endswith(b"\n"):
        event = read_event(line.decode(errors="replace"))
        if event is not None:
            yield event
    stream.seek(-len(line), os.SEEK_CUR)


def _is_at(stream: BinaryIO, path: Path) -> bool:
    """Whether the open file is the one that lies at the path; also true while none lies there."""
    try:
        return os.path.samestat(os.fstat(stream.fileno()), path.stat())
    except OSError:
        return True
