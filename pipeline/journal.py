"""What a run or a batch tells while it goes: each event to all that listen."""

from __future__ import annotations

import contextlib
import secrets
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace

from gsac.cache.record import Record
from gsac.pipeline.events import (
    ClipEnded,
    Event,
    Note,
    StageEvent,
    StageFailed,
    StageFinished,
    StageHit,
    StageLine,
    StageNote,
    StagePlanned,
    StageProgress,
    StageStarted,
    StageWarning,
)
from gsac.pipeline.pace import Course, Pace
from gsac.pipeline.reporter import PlainReporter

Listener = Callable[[Event], None]
"""Takes events, one at a time."""


class Journal(AbstractContextManager):
    """Gives events their time and the ids of the run at hand, and passes them on in the order in which they came.

    Threads may tell at once; a listener is called by one at a time.
    """

    def __init__(self, *listeners: Listener, clip: str = "", of_batch: bool = False):
        """clip: name of the clip that is run; of_batch: whether a batch tells, which has clips and no run of its own."""
        self.clip = clip
        self.batch, self.run = (new_id(), "") if of_batch else ("", new_id())
        self._listeners = list(listeners)
        self._lock = threading.RLock()
        self._course: Course | None = None
        self._pace, self._began = Pace(), 0.0

    def __exit__(self, *exc) -> None:
        pass

    @contextlib.contextmanager
    def heard_by(self, listener: Listener) -> Iterator[None]:
        """One more listens for a while."""
        self._listeners.append(listener)
        try:
            yield
        finally:
            self._listeners.remove(listener)

    def tell(self, event: Event) -> None:
        """An event of the run or batch at hand. One of a batch names its clip itself."""
        if isinstance(event, StageEvent):
            event = replace(event, place=self._place(event.stage))
        self._pass_on(replace(event, time=time.time(), batch=self.batch, run=self.run, clip=event.clip or self.clip))

    def relay(self, event: Event, clip: str, attempt: int = 1) -> None:
        """An event that a run of one of the batch's clips has told. clip: its name in this batch. Of the clip's end the batch
        itself tells: a run that was killed says none, and one that is tried once more is not the last."""
        if not isinstance(event, ClipEnded):
            self._pass_on(replace(event, batch=self.batch, clip=clip, attempt=attempt))

    def _pass_on(self, event: Event) -> None:
        with self._lock:
            for listener in self._listeners:
                listener(event)

    def note(self, message: str) -> None:
        """A line for people."""
        self.tell(Note(message=message))

    def result(self, message: str) -> None:
        """The line for which the command was run."""
        self.tell(Note(message=message, result=True))

    def follows(self, course: Course) -> None:
        """From here on each stage is told with its place in the run and the time that the run still takes."""
        self._course = course

    def starts(self, stage: str, reason: str, key: str = "", device: str = "") -> None:
        """A stage, or other work with progress, begins. reason: why, in words."""
        self._began, self._pace = time.monotonic(), Pace()
        if self._course is not None:
            self._course.begin(stage)
        self.tell(StageStarted(stage=stage, reason=reason, key=key, device=device))

    def progress(self, stage: str, done: int, total: int, unit: str) -> None:
        """How far it is."""
        now = time.monotonic()
        self._pace.hear(done, unit, now)
        left = None
        if self._course is not None and self._course.has(stage):
            left = self._course.seconds_left(stage, now - self._began, self._pace.seconds_left(total))
        self.tell(StageProgress(stage=stage, done=done, total=total, unit=unit, rate=self._pace.rate, run_left=left))

    def finishes(self, stage: str, seconds: float) -> None:
        """Work that is no stage has ended."""
        self.tell(StageFinished(stage=stage, seconds=seconds))

    def computed(self, record: Record) -> None:
        """A stage's result was computed and is in the store."""
        info, stage = record.info, record.parts.stage
        if self._course is not None:
            self._course.end(stage, info.seconds)
        self.tell(StageFinished(stage=stage, key=record.key, seconds=info.seconds, cpu_seconds=info.cpu_seconds,
                                peak_rss_mb=info.peak_rss_mb, bytes=record.bytes, device=info.device))

    def planned(self, stage: str, key: str, reason: str, seconds: float) -> None:
        """A stage has to be computed, or may have to. seconds: that it may take."""
        self.tell(StagePlanned(stage=stage, key=key, reason=reason, seconds=round(seconds, 3)))

    def found(self, record: Record) -> None:
        """A stage's result was in the cache."""
        self.tell(StageHit(stage=record.parts.stage, key=record.key, seconds=record.info.seconds,
                           cpu_seconds=record.info.cpu_seconds, bytes=record.bytes))

    def failed(self, stage: str, key: str, error: Exception) -> None:
        """A stage gave no result."""
        self.tell(StageFailed(stage=stage, key=key, error=str(error), killed=getattr(error, "killed", "")))

    def warning(self, stage: str, message: str, code: str = "", severity: str = "") -> None:
        """A stage's warning. code, severity: of its finding."""
        self.tell(StageWarning(stage=stage, message=message, code=code, severity=severity))

    def remark(self, stage: str, message: str) -> None:
        """A stage's note."""
        self.tell(StageNote(stage=stage, message=message))

    def log(self, stage: str, line: str) -> None:
        """A line that the stage printed."""
        self.tell(StageLine(stage=stage, line=line))

    def _place(self, stage: str) -> str:
        return self._course.place(stage) if self._course is not None and self._course.has(stage) else ""


def print_event(event: Event) -> None:
    """Prints it as a JSON line on stdout, at once: `--events`."""
    sys.stdout.write(event.to_line())
    sys.stdout.flush()


def plain_journal() -> Journal:
    """Told on stderr in plain lines."""
    return Journal(PlainReporter(sys.stderr).take)


def new_id() -> str:
    """Of a run or a batch."""
    return secrets.token_hex(8)
