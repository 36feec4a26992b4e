"""How a run reports to people: a progress bar in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol, TextIO

from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.pace import duration, progress_words
from gsac.pipeline.wrapping import fit
from gsac.stages.counting import counted

if TYPE_CHECKING:
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
        StageProgress,
        StageStarted,
        StageWarning,
    )

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


class Speaker(Protocol):
    """Says lines to people: a reporter, or a journal to which one listens."""

    def note(self, message: str) -> None: ...


class PlainReporter(AbstractContextManager):
    """One line an event."""

    def __init__(self, stream: TextIO | None = None, verbose: bool = False):
        self.verbose = verbose
        """Whether lines that stages print are told, too."""
        self._stream = stream or sys.stderr
        self._last = 0.0
        """Unix time of the last line on progress, or of the stage's begin."""

    def __exit__(self, *exc) -> None:
        pass

    def note(self, message: str) -> None:
        print(fit(message, self._stream), file=self._stream, flush=True)

    def result(self, message: str) -> None:
        """The line for which the command was run."""
        self.note(message)

    def foresees(self, stage: str, outcome: Outcome, seconds: float, detail: str) -> None:
        """A dry run's line on one stage."""
        self._end(stage, outcome, seconds, detail)

    def take(self, event: Event) -> None:
        """Tells an event of which a person wants to know at once; of a batch's clips its own reporter tells."""
        if event.kind in TOLD and not (event.batch and event.clip):
            getattr(self, f"_{event.kind}", self._tell)(event)

    def _tell(self, event: Event) -> None:
        self.note(words_of(event))

    def _note(self, event: Note) -> None:
        (self.result if event.result else self.note)(event.message)

    def _stage_started(self, event: StageStarted) -> None:
        self._last = event.time
        self._tell(event)

    def _stage_progress(self, event: StageProgress) -> None:
        if event.time - self._last >= PLAIN_GAP_S:
            self._last = event.time
            self._tell(event)

    def _stage_line(self, event: StageLine) -> None:
        if self.verbose:
            self._tell(event)

    def _stage_hit(self, event: StageHit) -> None:
        self._end(titled(event), Outcome.CACHED, event.seconds)

    def _stage_finished(self, event: StageFinished) -> None:
        self._end(titled(event), Outcome.RAN, event.seconds)

    def _stage_failed(self, event: StageFailed) -> None:
        self._end(titled(event), Outcome.FAILED, 0.0)

    def _end(self, title: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        """seconds: of the run that computed the result."""
        self.note(words_of_end(title, outcome, seconds, detail))


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

    def _stage_started(self, event: StageStarted) -> None:
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn
        from rich.table import Column

        self._close()
        cut = Column(no_wrap=True, overflow="ellipsis", ratio=1)
        self._bar = Progress(
            SpinnerColumn(), TextColumn("{task.fields[stage]:<14}", markup=False),
            BarColumn(BAR if self.console.width >= NARROW else NARROW_BAR),
            TextColumn("{task.fields[words]}", markup=False, table_column=cut), console=self.console, transient=True,
            expand=True,
        )
        self._bar.add_task("", total=None, stage=titled(event), words=f"reading and loading ({event.reason})")
        self._bar.start()

    def _stage_progress(self, event: StageProgress) -> None:
        if self._bar is None:
            return
        task, going_on = self._bar.tasks[0], event.done < event.total
        task.total, task.completed = (event.total, event.done) if going_on else (None, 0)  # a bar without a total pulses
        task.fields["words"] = words_of_progress(event) if going_on or not event.total else f"{event.done} {event.unit} {COUNTED}"

    def _stage_warning(self, event: StageWarning) -> None:
        self._print(f"{event.stage}: warning: {event.message}", "yellow")

    def _stage_note(self, event: StageNote) -> None:
        self._print(f"{event.stage}: note: {event.message}", "dim")

    def _end(self, title: str, outcome: Outcome, seconds: float, detail: str = "") -> None:
        self._close()
        took = f"{seconds:8.1f} s" if outcome is not Outcome.FAILED else " " * 10
        before = f"{title:<14} {took}  "
        self._print(f"{before}{outcome.value}{': ' + detail if detail else ''}", outcome.style, len(before))

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def titled(event: StageEvent) -> str:
    """`7/8 train`"""
    return f"{event.place} {event.stage}".strip()


def words_of_end(title: str, outcome: Outcome, seconds: float, detail: str = "") -> str:
    """`7/8 train: ran in 12.0 s`; seconds: of the run that computed the result."""
    time_words = f" in {seconds:.1f} s" if outcome is Outcome.RAN else ""
    time_words = f" (took {seconds:.1f} s when it ran)" if outcome is Outcome.CACHED else time_words
    return f"{title}: {outcome.value}{time_words}{': ' + detail if detail else ''}"


def words_of_progress(event: StageProgress) -> str:
    """The stage's progress, and what is left of the run where earlier runs tell."""
    words = progress_words(event.done, event.total, event.unit, event.rate)
    return words if event.run_left is None else f"{words}; whole run: about {duration(event.run_left)} left"


def words_of_clip(event: ClipEnded) -> str:
    """How a clip's run ended, what of it was computed, and how long it took."""
    end = "failed" if event.code else f"done, {event.ran} of {counted(event.stages, 'stage')} ran"
    return f"{end}, {counted(event.warnings, 'warning')}, {duration(event.seconds)}"


WORDS: dict[str, Callable[[Any], str]] = {
    "batch_started": lambda it: f"batch of {counted(it.clips, 'clip')} starts, {it.due} to do",
    "batch_ended": lambda it: f"batch ends after {duration(it.seconds)}, {it.failed} failed",
    "clip_planned": lambda it: f"planned, {', '.join(it.due) or 'nothing'} to do",
    "clip_kept": lambda it: f"left as it is ({it.status})",
    "clip_started": lambda it: "starts",
    "clip_ended": lambda it: words_of_clip(it) + (f": {it.error}" if it.error else ""),
    "stage_planned": lambda it: f"{titled(it)}: to do ({it.reason}){f', about {duration(it.seconds)}' if it.seconds else ''}",
    "stage_hit": lambda it: words_of_end(titled(it), Outcome.CACHED, it.seconds),
    "stage_started": lambda it: f"{titled(it)}: starts ({it.reason})",
    "stage_progress": lambda it: f"{titled(it)}: {words_of_progress(it)}",
    "stage_warning": lambda it: f"{it.stage}: warning: {it.message}",
    "stage_note": lambda it: f"{it.stage}: note: {it.message}",
    "stage_line": lambda it: f"{it.stage}: | {it.line}",
    "stage_finished": lambda it: words_of_end(titled(it), Outcome.RAN, it.seconds),
    "stage_failed": lambda it: words_of_end(titled(it), Outcome.FAILED, 0.0, it.error),
    "note": lambda it: it.message,
}
"""Kind of event -> a line on it."""
TOLD = {"note", "stage_hit", "stage_started", "stage_progress", "stage_warning", "stage_note", "stage_line", "stage_finished",
        "stage_failed"}
"""Kinds that a person is told while a run goes."""


def words_of(event: Event) -> str:
    """A line on an event for people, without its time and clip."""
    return WORDS[event.kind](event)


def open_reporter(verbosity: Verbosity = Verbosity.NORMAL, plain: bool = False) -> PlainReporter:
    """Of a command's progress, on stderr: a bar in a terminal unless plain lines are asked for."""
    if verbosity is Verbosity.QUIET:
        return QuietReporter()
    kind = PlainReporter if plain or not sys.stderr.isatty() else TerminalReporter
    return kind(verbose=verbosity is Verbosity.VERBOSE)
