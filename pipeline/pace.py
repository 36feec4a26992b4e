"""How fast a stage goes, where in its run it stands, and how long both still take."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import cache

WINDOW_S = 15.0
"""The rate is that of these last seconds: the first ones of a stage still compile, and mislead."""
SETTLED_S = 3.0
"""Seconds of progress before a rate is told."""


class Pace:
    """The rate of one phase of a stage."""

    def __init__(self) -> None:
        self._unit = ""
        self._heard: deque[tuple[float, int]] = deque()

    def hear(self, done: int, unit: str, now: float) -> None:
        """Takes up a sign of progress; another unit is another phase. now: s."""
        if unit != self._unit or done < self._heard[-1][1]:
            self._unit = unit
            self._heard.clear()
        self._heard.append((now, done))
        while len(self._heard) > 2 and now - self._heard[1][0] >= WINDOW_S:
            self._heard.popleft()

    def words(self, total: int) -> str:
        """`30/60 frames, 4.1 frames/s, 7 s left`"""
        return progress_words(self._heard[-1][1], total, self._unit, self.rate)

    def seconds_left(self, total: int) -> float:
        """s, of this phase; 0 where it is not known."""
        rate = self.rate
        return (total - self._heard[-1][1]) / rate if rate is not None and total else 0.0

    @property
    def rate(self) -> float | None:
        """Units/s; None until it has settled."""
        (began, before), (now, done) = self._heard[0], self._heard[-1]
        return (done - before) / (now - began) if now - began >= SETTLED_S and done > before else None


def progress_words(done: int, total: int, unit: str, rate: float | None) -> str:
    """`30/60 frames, 4.1 frames/s, 7 s left`; total: 0 where nobody knows. rate: units/s."""
    words = f"{done}/{total} {unit}" if total else f"{done} {unit}"
    if rate is not None:
        words += f", {rate:.3g} {unit}/s" if " " not in unit else ""
        if total > done:
            words += f", {duration((total - done) / rate)} left"
    return words


class Course:
    """The stages of a run in order, with the time that each took in an earlier one."""

    def __init__(self, steps: list[str], above: Callable[[str], set[str]], seconds: Callable[[str], float | None]):
        """above: what a stage needs; seconds: s that a stage usually takes, None where it never ran."""
        self._steps, self._above, self._seconds = steps, above, cache(seconds)
        self._begun: set[str] = set()
        self._usual = self._spent = 0.0

    def has(self, stage: str) -> bool:
        """Whether it is one of them: a benchmark reports other work, too, after a run."""
        return stage in self._steps

    def place(self, stage: str) -> str:
        """`7/8`"""
        return f"{self._steps.index(stage) + 1}/{len(self._steps)}"

    def begin(self, stage: str) -> None:
        """Notes that a stage is at work: those that need it will be, too. Its usual time is read now, before it is replaced."""
        self._begun.add(stage)
        self._seconds(stage)

    def end(self, stage: str, spent: float) -> None:
        """Notes how long a stage took, s: the later ones are expected to be faster or slower than usual, too."""
        usual = self._seconds(stage)
        if usual is not None:
            self._usual, self._spent = self._usual + usual, self._spent + spent

    def seconds_left(self, stage: str, elapsed: float, of_phase: float) -> float | None:
        """s, from a stage that is at work to the end of the run; None where a stage that is still to come never ran.

        elapsed: s, of the stage; of_phase: s, that its present phase still takes.
        """
        later = [name for name in self._steps[self._steps.index(stage) + 1:] if self._begun & self._above(name)]
        times = [self._seconds(name) for name in (stage, *later)]
        known = [time for time in times if time is not None]
        if len(known) < len(times):
            return None
        usual = sum(known)  # joins both sums, so that a short stage tells little of long ones
        ratio = (self._spent + usual) / (self._usual + usual) if usual else 1.0
        return max(known[0] * ratio - elapsed, of_phase) + sum(known[1:]) * ratio


def duration(seconds: float) -> str:
    """`7 s`, `2 min 5 s`, `1 h 3 min`"""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
