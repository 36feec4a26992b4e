"""batch.prom: counters of a batch in Prometheus' text form, for the textfile collector of its node exporter."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from gsac.pipeline.batch_entry import Entry, Status
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


def write_metrics(folder: Path, entries: Iterable[Entry]) -> None:
    """Writes the file whole or not at all."""
    entries = list(entries)
    count = Counter(entry.status for entry in entries)
    lines = [FIRST_LINE, "# TYPE gsac_batch_clips gauge"]
    lines += [f'gsac_batch_clips{{status="{status.value}"}} {count[status]}' for status in Status]
    lines += ["# HELP gsac_batch_seconds Time by the clock that runs of clips took.", "# TYPE gsac_batch_seconds gauge"]
    lines += [f'gsac_batch_seconds{{status="{status.value}"}} {_seconds(entries, status):.3f}' for status in Status]
    lines += ["# HELP gsac_batch_killed Runs of clips that a signal ended.", "# TYPE gsac_batch_killed gauge",
              f"gsac_batch_killed {sum(entry.killed for entry in entries)}"]
    lines += ["# HELP gsac_batch_written_seconds When this was written, in Unix time.", "# TYPE gsac_batch_written_seconds gauge",
              f"gsac_batch_written_seconds {time.time():.0f}"]
    write_text(folder / FILE, "\n".join(lines) + "\n")


def _seconds(entries: list[Entry], status: Status) -> float:
    return sum(entry.seconds for entry in entries if entry.status is status)
