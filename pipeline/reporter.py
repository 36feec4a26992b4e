"""How a run reports to people: a progress bar in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from enum import Enum
from typing import TextIO

from gsac.pipeline.outcomes import Outcome

PLAIN_GAP_S = 10.0
"""At least this long between two plain progress lines."""


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
        self._last = 0.0
        self._first: tuple[float, int] | None = None

    def __exit__(self, *exc) -> None:
        pass

    def note(self, message: str) -> None:
        print(message, file=self._stream, flush=True)

    def result(self, message: str) -> None:
        """The line for which the command was run."""
        self.note(message)

    def foresees(self, stage: str, outcome: Outcome, seconds: float, detail: str) -> None:
        """A dry run's line on one stage."""
        self.ends(stage, outcome, seconds, detail)

    def starts(self, stage: str, why: str) -> None:
        self._last, self._first = time.monotonic(), None
        self.note(f"{stage}: starts ({why})")

    def progress(self, stage: str, done: int, total: int, unit: str) -> None:
        words = self._words(done, total, unit)
        now = time.monotonic()
        if now - self._last < PLAIN_GAP_S:
            return
        self._last = now
        self.note(f"{stage}: {words}")

    def _words(self, done: int, total: int, unit: str) -> str:
        """The rate counts from the first progress event: before it the stage was loading and compiling."""
        now = time.monotonic()
        self._first = self._first or (now, done)
        return progress_words(done, total, unit, now - self._first[0], self._first[1])

    def warning(self, stage: str, message: str) -> None:
        self.note(f"{stage}: warning: {message}")

    def remark(self, stage: str, message: str) -> None:
        """A stage's note."""
        self.note(f"{stage}: note: {message}")

    def log(self, stage: str, line: str) -> None:
        """A line that the stage printed; only asked for where `verbose`."""
        self.note(f"{stage}: | {line}")

    def ends(self, stage: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        time_words = f" in {seconds:.1f} s" if outcome is Outcome.RAN else ""
        time_words = f" (took {seconds:.1f} s when it ran)" if outcome is Outcome.CACHED else time_words
        self.note(f"{stage}: {outcome.value}{time_words}{': ' + detail if detail else ''}")


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
        self._console = Console(file=self._stream, highlight=False)
        self._bar = None
        self._task = None

    def __exit__(self, *exc) -> None:
        self._close()

    def note(self, message: str) -> None:
        self._console.print(message, markup=False, soft_wrap=True)

    def starts(self, stage: str, why: str) -> None:
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

        self._close()
        self._first = None
        self._bar = Progress(
            SpinnerColumn(), TextColumn("{task.fields[stage]:<10}", markup=False), BarColumn(),
            TextColumn("{task.fields[words]}", markup=False), console=self._console, transient=True,
        )
        self._task = self._bar.add_task("", total=None, stage=stage, words=why)
        self._bar.start()

    def progress(self, stage: str, done: int, total: int, unit: str) -> None:
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done, total=total or None, words=self._words(done, total, unit))

    def warning(self, stage: str, message: str) -> None:
        self._console.print(f"{stage}: warning: {message}", style="yellow", markup=False, soft_wrap=True)

    def remark(self, stage: str, message: str) -> None:
        self._console.print(f"{stage}: note: {message}", style="dim", markup=False, soft_wrap=True)

    def ends(self, stage: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        self._close()
        took = f"{seconds:8.1f} s" if outcome is not Outcome.FAILED else " " * 10
        self._console.print(f"{stage:<10} {took}  ", end="", markup=False)
        self._console.print(f"{outcome.value}{': ' + detail if detail else ''}", style=outcome.style, markup=False,
                            soft_wrap=True)

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


def progress_words(done: int, total: int, unit: str, elapsed_s: float, before: int = 0) -> str:
    """`30/60 frames, 4.1 frames/s, 7 s left`; before: how many were done when the time began."""
    words = f"{done}/{total} {unit}" if total else f"{done} {unit}"
    if done > before and elapsed_s > 0:
        rate = (done - before) / elapsed_s
        words += f", {rate:.3g} {unit}/s"
        if total:
            words += f", {duration((total - done) / rate)} left"
    return words


def duration(seconds: float) -> str:
    """`7 s`, `2 min 5 s`, `1 h 3 min`"""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
