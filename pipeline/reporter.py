"""How a run reports to people: a progress bar in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from enum import Enum
from typing import TextIO

from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.pace import Course, Pace, duration
from gsac.pipeline.wrapping import fit

PLAIN_GAP_S = 10.0
"""At least this long between two plain progress lines."""
BAR = 20
"""Columns of the bar."""
NARROW, NARROW_BAR = 80, 6
"""Below so many columns of the terminal the bar has so many."""
COUNTED = "done; still at work"
"""Shown where all of a phase is counted and the stage goes on: a full bar would look hung."""


class Verbosity(Enum):
    """How much a command tells; the value is the name of its option."""

    QUIET = "quiet"
    NORMAL = "normal"
    VERBOSE = "verbose"

    @property
    def sentence(self) -> str:
        return _SENTENCES[self]


_SENTENCES = {
    Verbosity.QUIET: "only errors and the result",
    Verbosity.NORMAL: "each stage as it starts and ends, its progress, warnings and notes",
    Verbosity.VERBOSE: "also the lines that stages print into their logs",
}


class PlainReporter(AbstractContextManager):
    """One line an event."""

    def __init__(self, stream: TextIO | None = None, verbose: bool = False):
        self.verbose = verbose
        self._stream = stream or sys.stderr
        self._last = self._began = 0.0
        self._pace = Pace()
        self._course: Course | None = None

    def __exit__(self, *exc) -> None:
        pass

    def note(self, message: str) -> None:
        print(fit(message, self._stream), file=self._stream, flush=True)

    def result(self, message: str) -> None:
        """The line for which the command was run."""
        self.note(message)

    def foresees(self, stage: str, outcome: Outcome, seconds: float, detail: str) -> None:
        """A dry run's line on one stage."""
        self.ends(stage, outcome, seconds, detail)

    def follows(self, course: Course) -> None:
        """From here on each stage is told with its place in the run and the time that the run still takes."""
        self._course = course

    def starts(self, stage: str, why: str) -> None:
        self._begin(stage)
        self._last = self._began
        self.note(f"{self._titled(stage)}: starts ({why})")

    def progress(self, stage: str, done: int, total: int, unit: str) -> None:
        now = time.monotonic()
        words = self._words(stage, done, total, unit, now)
        if now - self._last >= PLAIN_GAP_S:
            self._last = now
            self.note(f"{self._titled(stage)}: {words}")

    def _begin(self, stage: str) -> None:
        self._began, self._pace = time.monotonic(), Pace()
        if self._course is not None:
            self._course.begin(stage)

    def _end(self, stage: str, outcome: Outcome, seconds: float) -> None:
        if self._course is not None and outcome is Outcome.RAN:
            self._course.end(stage, seconds)

    def _titled(self, stage: str) -> str:
        """`7/8 train`"""
        return f"{self._course.place(stage)} {stage}" if self._course is not None and self._course.has(stage) else stage

    def _words(self, stage: str, done: int, total: int, unit: str, now: float) -> str:
        """The stage's progress, and what is left of the run where earlier runs tell."""
        self._pace.hear(done, unit, now)
        words = self._pace.words(total)
        if self._course is None or not self._course.has(stage):
            return words
        left = self._course.seconds_left(stage, now - self._began, self._pace.seconds_left(total))
        return words if left is None else f"{words}; whole run: about {duration(left)} left"

    def warning(self, stage: str, message: str) -> None:
        self.note(f"{stage}: warning: {message}")

    def remark(self, stage: str, message: str) -> None:
        """A stage's note."""
        self.note(f"{stage}: note: {message}")

    def log(self, stage: str, line: str) -> None:
        """A line that the stage printed; only asked for where `verbose`."""
        self.note(f"{stage}: | {line}")

    def ends(self, stage: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        self._end(stage, outcome, seconds)
        time_words = f" in {seconds:.1f} s" if outcome is Outcome.RAN else ""
        time_words = f" (took {seconds:.1f} s when it ran)" if outcome is Outcome.CACHED else time_words
        self.note(f"{self._titled(stage)}: {outcome.value}{time_words}{': ' + detail if detail else ''}")


class QuietReporter(PlainReporter):
    """The result alone."""

    def note(self, message: str) -> None:
        pass

    def result(self, message: str) -> None:
        super().note(message)

    def foresees(self, stage: str, outcome: Outcome, seconds: float, detail: str) -> None:
        PlainReporter(self._stream).foresees(stage, outcome, seconds, detail)


class TerminalReporter(PlainReporter):
    """A bar with rate and time left under the lines, while a stage runs."""

    def __init__(self, stream: TextIO | None = None, verbose: bool = False):
        from rich.console import Console

        super().__init__(stream, verbose)
        self.console = Console(file=self._stream, highlight=False)
        self._bar = None

    def __exit__(self, *exc) -> None:
        self._close()

    def note(self, message: str) -> None:
        self._print(message)

    def _print(self, message: str, style: str = "", begin: int = 0) -> None:
        """Prints a line broken between words; style: of what follows its first `begin` characters."""
        from rich.text import Text

        text = Text(fit(message, self._stream))
        text.stylize(style, begin)
        self.console.print(text, soft_wrap=True)

    def starts(self, stage: str, why: str) -> None:
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn
        from rich.table import Column

        self._close()
        self._begin(stage)
        cut = Column(no_wrap=True, overflow="ellipsis", ratio=1)
        self._bar = Progress(
            SpinnerColumn(), TextColumn("{task.fields[stage]:<14}", markup=False),
            BarColumn(BAR if self.console.width >= NARROW else NARROW_BAR),
            TextColumn("{task.fields[words]}", markup=False, table_column=cut), console=self.console, transient=True,
            expand=True,
        )
        self._bar.add_task("", total=None, stage=self._titled(stage), words=f"reading and loading ({why})")
        self._bar.start()

    def progress(self, stage: str, done: int, total: int, unit: str) -> None:
        if self._bar is None:
            return
        words, task = self._words(stage, done, total, unit, time.monotonic()), self._bar.tasks[0]
        going_on = done < total
        task.total, task.completed = (total, done) if going_on else (None, 0)  # a bar without a total pulses
        task.fields["words"] = words if going_on or not total else f"{done} {unit} {COUNTED}"

    def warning(self, stage: str, message: str) -> None:
        self._print(f"{stage}: warning: {message}", "yellow")

    def remark(self, stage: str, message: str) -> None:
        self._print(f"{stage}: note: {message}", "dim")

    def ends(self, stage: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        self._close()
        self._end(stage, outcome, seconds)
        took = f"{seconds:8.1f} s" if outcome is not Outcome.FAILED else " " * 10
        title = f"{self._titled(stage):<14} {took}  "
        self._print(f"{title}{outcome.value}{': ' + detail if detail else ''}", outcome.style, len(title))

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def open_reporter(verbosity: Verbosity = Verbosity.NORMAL, plain: bool = False) -> PlainReporter:
    """Of a command's progress, on stderr: a bar in a terminal unless plain lines are asked for."""
    if verbosity is Verbosity.QUIET:
        return QuietReporter()
    kind = PlainReporter if plain or not sys.stderr.isatty() else TerminalReporter
    return kind(verbose=verbosity is Verbosity.VERBOSE)
