"""Clips of a batch of which all results are in the cache: their folders are brought up to date without a process of their own."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

from gsac.pipeline.clip_work import ClipWork
from gsac.pipeline.errors import attached_summary, ending
from gsac.pipeline.executors.executor import ClipJob, ClipResult, Hear
from gsac.pipeline.journal import Journal
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run_folder import RunFolder


def run_unchanged(work: ClipWork, jobs: Iterable[ClipJob], keys: Keys, hear: Hear) -> Iterator[ClipResult]:
    """Results one by one. keys: those that the clips were planned with; hear: told what happens.

    Each result is looked up again, a tenth of the work: a large batch is planned for minutes, and the cache may have been cleaned
    meanwhile.
    """
    for job in jobs:
        began = time.monotonic()
        mine = replace(work, journal=Journal(partial(hear, job), clip=job.name))
        try:
            summary, code, error = mine.do(job.clip.resolve(), RunFolder(job.out), keys).summary(), ExitCode.OK, ""
        except Exception as failure:
            summary, (code, error) = attached_summary(failure), ending(failure)
        yield ClipResult(job, code, time.monotonic() - began, error, summary, unchanged=True)
