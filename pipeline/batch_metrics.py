"""batch.prom: counters of a batch in Prometheus' text form, for the textfile collector of its node exporter."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from gsac.pipeline.batch_entry import Entry, Status
from gsac.pipeline.events import Event, StageFailed, StageFinished, StageHit, StageWarning
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.run_folder import write_text
from gsac.stages.contract import BadInput

FILE = "batch.prom"
FIRST_LINE = "# HELP gsac_batch_clips Clips of the batch by what became of them."
"""Tells the file from one of the user's by the same name."""


def refuse_foreign(folder: Path) -> None:
    """BadInput where a file that is not of gsac's making has the name of the counters."""
    path = folder / FILE
    if path.exists() and not path.read_bytes().startswith(FIRST_LINE.encode()):
        raise BadInput(f"{path} was not written by `gsac batch`, which would write over it; move it away, or give another --out")


class StageCounters:
    """What was told of stages since the command began."""

    def __init__(self) -> None:
        self.ends: Counter[tuple[str, Outcome]] = Counter()
        """Stage and outcome -> how often."""
        self.seconds: defaultdict[str, float] = defaultdict(float)
        """Stage -> s by the clock, of those that were computed."""
        self.cpu_seconds: defaultdict[str, float] = defaultdict(float)
        self.bytes: Counter[str] = Counter()
        """Stage -> size of the outputs that were made."""
        self.warnings: Counter[tuple[str, str]] = Counter()
        """Stage and code -> how often."""

    def take(self, event: Event) -> None:
        """Counts an event of a stage."""
        if isinstance(event, StageHit):
            self.ends[event.stage, Outcome.CACHED] += 1
        elif isinstance(event, StageFailed):
            self.ends[event.stage, Outcome.FAILED] += 1
        elif isinstance(event, StageWarning):
            self.warnings[event.stage, event.code] += 1
        elif isinstance(event, StageFinished):
            self.ends[event.stage, Outcome.RAN] += 1
            self.seconds[event.stage] += event.seconds
            self.cpu_seconds[event.stage] += event.cpu_seconds
            self.bytes[event.stage] += event.bytes


def write_metrics(folder: Path, entries: Iterable[Entry], stages: StageCounters) -> None:
    """Writes the file whole or not at all."""
    entries = list(entries)
    count = Counter(entry.status for entry in entries)
    lines = [FIRST_LINE, "# TYPE gsac_batch_clips gauge"]
    lines += [f'gsac_batch_clips{{status="{status.value}"}} {count[status]}' for status in Status]
    lines += ["# HELP gsac_batch_seconds Time by the clock that runs of clips took.", "# TYPE gsac_batch_seconds gauge"]
    lines += [f'gsac_batch_seconds{{status="{status.value}"}} {_seconds(entries, status):.3f}' for status in Status]
    lines += ["# HELP gsac_batch_killed Runs of clips that a signal ended.", "# TYPE gsac_batch_killed gauge",
              f"gsac_batch_killed {sum(entry.killed for entry in entries)}"]
    lines += _series("gsac_batch_stage_ends", "Stages by how they ended, since the command began.",
                     [(f'stage="{stage}",outcome="{outcome.value}"', f"{n}") for (stage, outcome), n in stages.ends.items()])
    lines += _series("gsac_batch_stage_seconds", "Time by the clock of stages that were computed.", _by_stage(stages.seconds))
    lines += _series("gsac_batch_stage_cpu_seconds", "CPU time of stages that were computed.", _by_stage(stages.cpu_seconds))
    lines += _series("gsac_batch_stage_bytes", "Size of the outputs of stages that were computed.", _by_stage(stages.bytes))
    lines += _series("gsac_batch_stage_warnings", "Warnings by stage and code of the finding.",
                     [(f'stage="{stage}",code="{code}"', f"{n}") for (stage, code), n in stages.warnings.items()])
    lines += ["# HELP gsac_batch_written_seconds When this was written, in Unix time.", "# TYPE gsac_batch_written_seconds gauge",
              f"gsac_batch_written_seconds {time.time():.0f}"]
    write_text(folder / FILE, "\n".join(lines) + "\n")


def _series(name: str, meaning: str, values: list[tuple[str, str]]) -> list[str]:
    """values: labels and value of each."""
    return [f"# HELP {name} {meaning}", f"# TYPE {name} gauge", *(f"{name}{{{labels}}} {value}" for labels, value in values)]


def _by_stage(values: Mapping[str, float]) -> list[tuple[str, str]]:
    return [(f'stage="{stage}"', f"{value:.3f}") for stage, value in values.items()]


def _seconds(entries: list[Entry], status: Status) -> float:
    return sum(entry.seconds for entry in entries if entry.status is status)
