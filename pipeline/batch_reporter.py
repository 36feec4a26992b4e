"""How a batch reports while its clips run: a table in a terminal with a row for each clip at work, plain lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from gsac.pipeline.events import ClipEnded, Event, Note, StageLine
from gsac.pipeline.pace import duration
from gsac.pipeline.reporter import PLAIN_GAP_S, TOLD, PlainReporter, TerminalReporter, words_of, words_of_clip
from gsac.stages.counting import counted

if TYPE_CHECKING:
    from rich.table import Table


WARNING = "gsac: warning: "
"""Begin of a note that also a clip without work is heard with."""
WORTH_S = 5.0
"""s before which a batch has no rate worth telling."""


class BatchReporter(AbstractContextManager):
    """Tells what the runs of clips are at, some lines of each, and how each ended."""

    def __init__(self, reporter: PlainReporter, clips: Mapping[str, float]):
        """clips: name -> seconds that it may take, of those that are to be run."""
        self._reporter, self._clips = reporter, dict(clips)
        self._whole, self._began = sum(clips.values()), time.monotonic()
        self._last: dict[str, float] = {}
        self._done, self._whole_done = 0, 0.0

    def __exit__(self, *exc) -> None:
        pass

    def take(self, event: Event) -> None:
        """Tells of a clip's run; of one that is unchanged only a warning or a failure."""
        if not event.clip:
            return
        at_work = event.clip in self._clips
        if isinstance(event, ClipEnded):
            if at_work or event.code:
                self._end(event)
        elif at_work and event.kind in TOLD and not isinstance(event, StageLine):
            self._hear(event.clip, words_of(event))
        elif isinstance(event, Note) and event.message.startswith(WARNING):
            self._reporter.note(event.message)

    def _hear(self, clip: str, line: str) -> None:
        """line: what its run is at."""
        now = time.monotonic()
        if now - self._last.get(clip, -PLAIN_GAP_S) >= PLAIN_GAP_S:
            self._last[clip] = now
            self._reporter.note(f"{clip}: {line}")

    def _end(self, event: ClipEnded) -> None:
        self._done += event.clip in self._clips
        self._whole_done += self._clips.get(event.clip, 0.0)
        self._reporter.note(f"{event.clip}: {words_of_clip(event)} ({self.course()})")

    def course(self) -> str:
        """`3 of 12 clips, 1.5 a minute, about 6 min left`"""
        words, passed = [f"{self._done} of {counted(len(self._clips), 'clip')}"], time.monotonic() - self._began
        share = self._whole_done / self._whole if self._whole else self._done / max(1, len(self._clips))
        if self._done and passed >= WORTH_S:
            words.append(f"{60 * self._done / passed:.2g} a minute")
            words += [f"about {duration(passed * (1 - share) / share)} left"] if 0 < share < 1 else []
        return ", ".join(words)


class BatchTable(BatchReporter):
    """The last line of each clip at work, under the lines of those that have ended."""

    def __init__(self, reporter: TerminalReporter, clips: Mapping[str, float]):
        from rich.live import Live

        super().__init__(reporter, clips)
        self._rows: dict[str, str] = {}
        self._live = Live(console=reporter.console, get_renderable=self.draw, refresh_per_second=4, transient=True)
        self._live.start()

    def __exit__(self, *exc) -> None:
        self._live.stop()

    def _hear(self, clip: str, line: str) -> None:
        self._rows[clip] = line

    def _end(self, event: ClipEnded) -> None:
        self._rows.pop(event.clip, None)
        super()._end(event)

    def draw(self) -> Table:
        """The table as it stands."""
        from rich.table import Table
        from rich.text import Text

        table = Table.grid(padding=(0, 2))
        table.add_column(no_wrap=True, max_width=30, overflow="ellipsis", style="cyan")
        table.add_column(no_wrap=True, overflow="ellipsis")
        for clip, line in list(self._rows.items()):
            table.add_row(Text(clip), Text(line))
        table.add_row(Text("batch", style="bold"), Text(self.course()))
        return table


def open_batch_reporter(reporter: PlainReporter, clips: Mapping[str, float]) -> BatchReporter:
    """Of the kind that fits the command's own reporter. clips: name -> seconds that it may take."""
    return BatchTable(reporter, clips) if isinstance(reporter, TerminalReporter) else BatchReporter(reporter, clips)
