"""What came of the trials of one attack."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import Enum


class Fault(Enum):
    """What an attack must never find; the value is the table's heading."""

    TORN = "torn"
    LOST = "lost"
    WRONG = "wrong"
    STUCK = "stuck"
    LEFT = "left over"

    @property
    def sentence(self) -> str:
        return _FAULTS[self]


_FAULTS = {
    Fault.TORN: "a result that counts as done and is not whole",
    Fault.LOST: "a finished result that has to be made again",
    Fault.WRONG: "a result of other bytes than an undisturbed run gives",
    Fault.STUCK: "a rerun that fails or does not end, or a stage that outlives its run by more than two seconds",
    Fault.LEFT: "a file of the killed command that is still there after the next has begun",
}


@dataclass
class Tally:
    """Trials and faults of one attack."""

    attack: str
    """The sentence of the table's row."""
    trials: int = 0
    faults: Counter[Fault] = field(default_factory=Counter)
    where: Counter[str] = field(default_factory=Counter)
    """How many trials hit what: a stage, a system call."""
    examples: list[str] = field(default_factory=list)
    longest_s: float = 0.0
    """How long a process outlived its parent at most."""

    def fault(self, fault: Fault, what: str) -> None:
        """Counts a fault and keeps what was seen."""
        self.faults[fault] += 1
        self.examples.append(f"{fault.value}: {what}")


def write_table(tallies: list[Tally]) -> str:
    """The trials as Markdown."""
    lines = [f"| attack | trials | {' | '.join(fault.value for fault in Fault)} | hit |",
             f"| --- | ---: | {'---: | ' * len(Fault)}--- |"]
    for tally in tallies:
        counts = " | ".join(str(tally.faults[fault]) for fault in Fault)
        hit = ", ".join(f"{name} {count}" for name, count in tally.where.most_common())
        lines.append(f"| {tally.attack} | {tally.trials} | {counts} | {hit} |")
    return "\n".join(lines) + "\n"
