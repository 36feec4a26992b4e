"""batch.json: what a batch was asked for and what became of each clip, for `--resume`, `--changed-only` and the page."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from gsac.pipeline.batch_entry import Entry, Status, status_of
from gsac.pipeline.batch_metrics import refuse_foreign, write_metrics
from gsac.pipeline.batch_plan import ClipPlan
from gsac.pipeline.executors.executor import ClipJob, ClipResult
from gsac.pipeline.rows import read_json
from gsac.pipeline.run_folder import RUN, write_text
from gsac.stages.contract import BadInput

FILE = "batch.json"
VERSION = 1
GAP_S = 2.0
"""s between two writings while clips end; a batch that is killed does at most so much again, which the cache answers."""


class BatchRecord:
    """The file batch.json in the folder of a batch."""

    def __init__(self, folder: Path, request: dict[str, Any]):
        """request: the words of the command that `--resume` needs. Raises BadInput where another's file has its name, or
        that of its counters."""
        self.path = folder.absolute() / FILE
        self.request = request
        self.entries: dict[ClipJob, Entry] = {}
        self._written = 0.0
        self._before = {(entry.clip, entry.out): entry for entry in read_entries(self.path)}
        self._reached = read_request(self.path).get("until") if self._before else None
        refuse_foreign(self.path.parent)

    def plan(self, plans: list[ClipPlan]) -> None:
        """Notes the clips before any of them runs."""
        for plan in plans:
            before = self.earlier(plan.job)
            self.entries[plan.job] = Entry(str(plan.job.clip), str(plan.job.out), digest=plan.digest,
                                           before=before.metrics if before is not None and before.digest == plan.digest else {})
        self.write(now=True)

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

    def end(self, result: ClipResult) -> None:
        """Notes the end of a clip."""
        entry = self.entries[result.job]
        entry.status, entry.code = status_of(result), result.code
        entry.seconds, entry.error = result.seconds, result.error
        entry.killed, entry.metrics = result.killed, result.summary.get("metrics") or {}
        self.write()

    def keep(self, job: ClipJob, earlier: Entry, status: Status) -> None:
        """Notes that a clip is left as the batch before has left it."""
        self.entries[job] = replace(earlier, status=status)

    def write(self, now: bool = False) -> None:
        """Writes the file whole or not at all, every few seconds while clips end."""
        if now or time.monotonic() - self._written >= GAP_S:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = {"version": VERSION, "request": self.request, "clips": [entry.to_json() for entry in self.entries.values()]}
            write_text(self.path, json.dumps(content, indent=1) + "\n")
            write_metrics(self.path.parent, self.entries.values())
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
