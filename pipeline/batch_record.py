"""batch.json: what a batch was asked for and what became of each clip, for `--resume`, `--changed-only` and the page."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from gsac.pipeline.batch_entry import Entry, Status
from gsac.pipeline.batch_metrics import StageCounters, refuse_foreign, write_metrics
from gsac.pipeline.batch_plan import ClipPlan
from gsac.pipeline.events import ClipEnded, ClipKept, ClipPlanned, Event
from gsac.pipeline.executors.executor import ClipJob
from gsac.pipeline.rows import read_json
from gsac.pipeline.run_folder import RUN, write_text
from gsac.stages.contract import BadInput

FILE = "batch.json"
VERSION = 1
GAP_S = 2.0
"""s between two writings while clips end; a batch that is killed does at most so much again, which the cache answers."""


class BatchRecord:
    """The file batch.json in the folder of a batch, and its counters: what the batch's journal tells, as it stands."""

    def __init__(self, folder: Path, request: dict[str, Any], jobs: Iterable[ClipJob]):
        """jobs: all clips; request: the words of the command that `--resume` needs. Raises BadInput where another's file has its
        name, or that of its counters."""
        self.path = folder.absolute() / FILE
        self.request = request
        self.entries: dict[str, Entry] = {}
        """By name of the clip."""
        self._jobs = {job.name: job for job in jobs}
        self._stages = StageCounters()
        self._written = 0.0
        self._before = {(entry.clip, entry.out): entry for entry in read_entries(self.path)}
        self._reached = read_request(self.path).get("until") if self._before else None
        refuse_foreign(self.path.parent)

    def take(self, event: Event) -> None:
        """Notes what becomes of a clip."""
        self._stages.take(event)
        if isinstance(event, ClipPlanned):
            job = self._jobs[event.clip]
            before = self.earlier(job)
            self.entries[event.clip] = Entry(str(job.clip), str(job.out), digest=event.digest,
                                             before=before.metrics if before is not None and before.digest == event.digest else {})
        elif isinstance(event, ClipKept) and (before := self.earlier(self._jobs[event.clip])) is not None:
            self.entries[event.clip] = replace(before, status=Status(event.status))
        elif isinstance(event, ClipEnded):
            entry = self.entries[event.clip]
            entry.status, entry.code, entry.seconds = Status(event.status), event.code, event.seconds
            entry.error, entry.killed, entry.metrics = event.error, event.killed, event.metrics
            self.write()

    def earlier(self, job: ClipJob) -> Entry | None:
        """What the batch before has said of a clip in this folder."""
        return self._before.get((str(job.clip), str(job.out)))

    def ended(self, job: ClipJob) -> Entry | None:
        """What the batch before has made of a clip; None where it has not ended, or where its results are gone."""
        entry = self.earlier(job)
        there = entry is not None and entry.status.is_end and (entry.status is Status.FAILED or (job.out / RUN).is_file())
        return entry if there else None

    def unchanged(self, plan: ClipPlan) -> Entry | None:
        """The same where the clip was done as far as it is asked for now, and its file is as it was."""
        entry = self.ended(plan.job)
        same = entry is not None and entry.status is not Status.FAILED and self._reached == self.request["until"]
        return entry if same and entry is not None and entry.digest == plan.digest else None

    @property
    def failed(self) -> list[Entry]:
        """Clips that failed."""
        return [entry for entry in self.entries.values() if entry.status is Status.FAILED]

    def write(self, now: bool = False) -> None:
        """Writes the file whole or not at all, every few seconds while clips end."""
        if now or time.monotonic() - self._written >= GAP_S:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = {"version": VERSION, "request": self.request, "clips": [entry.to_json() for entry in self.entries.values()]}
            write_text(self.path, json.dumps(content, indent=1) + "\n")
            write_metrics(self.path.parent, self.entries.values(), self._stages)
            self._written = time.monotonic()


def read_entries(path: Path) -> list[Entry]:
    """Clips of a batch.json; none where there is no file. Raises BadInput where it is not one of ours."""
    if not path.exists():
        return []
    clips = _content(path)["clips"]
    return [entry for entry in map(Entry.read, clips if isinstance(clips, list) else []) if entry is not None]


def read_request(path: Path) -> dict[str, Any]:
    """The words of the command that wrote a batch.json. Raises BadInput without one."""
    if not path.exists():
        raise BadInput(f"{path}: no such file; --resume goes on with a batch that was begun in this folder (--out)")
    return _content(path)["request"]


def _content(path: Path) -> dict[str, Any]:
    content = read_json(path)
    if not isinstance(content, dict) or content.get("version") != VERSION or not isinstance(content.get("request"), dict) \
            or "clips" not in content:
        raise BadInput(f"{path} was not written by this version of `gsac batch`; move it away, or give another --out")
    return content
