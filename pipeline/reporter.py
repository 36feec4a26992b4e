"""How a run speaks to people, on stderr: a progress bar in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from typing import TextIO

from gsac.pipeline.outcomes import Outcome

PLAIN_GAP_S = 10.0
"""Plain progress lines come at most this often."""


class PlainReporter(AbstractContextManager):
    """One line an event."""

    def __init__(self, stream: TextIO | None = None):
        self._stream = stream or sys.stderr
        self._last = 0.0
        self._first: tuple[float, int] | None = None

    def __exit__(self, *exc) -> None:
        pass

    def note(self, message: str) -> None:
        print(message, file=self._stream, flush=True)

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
        """The rate counts from the first sign of progress: what came before was loading and compiling."""
        now = time.monotonic()
        self._first = self._first or (now, done)
        return progress_words(done, total, unit, now - self._first[0], self._first[1])

    def warning(self, stage: str, message: str) -> None:
        self.note(f"{stage}: warning: {message}")

    def ends(self, stage: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        time_words = f" in {seconds:.1f} s" if outcome is Outcome.RAN else ""
        time_words = f" (took {seconds:.1f} s when it ran)" if outcome is Outcome.CACHED else time_words
        self.note(f"{stage}: {outcome.value}{time_words}{': ' + detail if detail else ''}")


class TerminalReporter(PlainReporter):
    """A bar with rate and time left under the lines, while a stage runs."""

    def __init__(self, stream: TextIO | None = None):
        from rich.console import Console

        super().__init__(stream)
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
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total or None, words=self._words(done, total, unit))

    def warning(self, stage: str, message: str) -> None:
        self._console.print(f"{stage}: warning: {message}", style="yellow", markup=False, soft_wrap=True)

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


def reporter(plain: bool = False) -> PlainReporter:
    """The bar where people look on, else lines."""
    return PlainReporter() if plain or not sys.stderr.isatty() else TerminalReporter()


def progress_words(done: int, total: int, unit: str, elapsed_s: float, before: int = 0) -> str:
    """`30/60 frames, 4.1 frames/s, 7 s left`; `before`: how many were done when the time began."""
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
