"""Clips of a batch of which all results are in the cache: their folders are brought up to date without a process of their own."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

from gsac.pipeline.clip_work import ClipWork
from gsac.pipeline.errors import attached_summary, exit_code, sentence
from gsac.pipeline.executors.executor import ClipJob, ClipResult
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.run_folder import RunFolder


class Mute(PlainReporter):
    """Tells what was moved aside or could not be written, and nothing of stages that need not run."""

    def __init__(self, reporter: PlainReporter):
        super().__init__()
        self._reporter = reporter

    def note(self, message: str) -> None:
        if message.startswith("gsac: warning: "):
            self._reporter.note(message)


def run_unchanged(work: ClipWork, jobs: Iterable[ClipJob], keys: Keys) -> Iterator[ClipResult]:
    """Results one by one. keys: those that the clips were planned with."""
    work = replace(work, reporter=Mute(work.reporter))
    for job in jobs:
        began = time.monotonic()
        try:
            summary, code, error = work.do(job.clip.resolve(), RunFolder(job.out), keys).summary(), ExitCode.OK, ""
        except Exception as failure:
            summary, code, error = attached_summary(failure), exit_code(failure), sentence(failure)
            if code is None:  # a bug of ours costs this clip alone
                code, error = ExitCode.FAILED, f"{type(failure).__name__}: {failure}"
        yield ClipResult(job, code, time.monotonic() - began, error, summary, unchanged=True)
