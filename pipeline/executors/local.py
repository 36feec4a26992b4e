"""A pool of processes on this machine, one a clip: a clip that kills its process harms no other clip.

A clip whose process is killed, as by a machine that ran out of memory, is tried once more, alone; then it is set aside.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, as_completed

from gsac.pipeline.executors.clip_process import THREADS, run_process
from gsac.pipeline.executors.executor import ClipJob, ClipResult, Hear, Limits
from gsac.pipeline.executors.memory import Memory
from gsac.pipeline.outcomes import ExitCode


class LocalExecutor:
    """Runs `gsac run` for each clip. hear: gets what their runs tell."""

    def __init__(self, limits: Limits, hear: Hear):
        self._hear, self._memory = hear, Memory(limits.memory_mb)
        self._leaving = False
        self._pool = ThreadPoolExecutor(limits.workers)  # the threads only wait for their process
        self._futures: list[Future[ClipResult]] = []
        self._running: set[subprocess.Popen] = set()
        share = str(max(1, (os.cpu_count() or 1) // limits.workers))
        self._environment = dict.fromkeys(THREADS, share) | os.environ

    def __enter__(self) -> LocalExecutor:
        return self

    def __exit__(self, *exc) -> None:
        self._leaving = True
        self._memory.end()
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in list(self._running):
            _end(process)
        self._pool.shutdown(wait=True)

    def submit(self, job: ClipJob) -> None:
        self._futures.append(self._pool.submit(self._run, job))

    def collect(self) -> Iterator[ClipResult]:
        for future in as_completed(self._futures):
            yield future.result()

    def _run(self, job: ClipJob) -> ClipResult:
        result, killed, wanted = None, 0, job.peak_mb
        while result is None or (killed == 1 and result.was_killed and not self._leaving):
            with self._memory.take(wanted) as may_start:
                if not may_start:
                    return result or ClipResult(job, ExitCode.INTERRUPTED, 0.0, "the batch ended before its turn")
                result = run_process(job, self._environment, lambda event, attempt=killed + 1: self._hear(job, event, attempt),
                                     self._while_running)
            killed, wanted = killed + result.was_killed, self._memory.limit_mb
        return result.set_aside(killed, "with no other clip beside it")

    @contextlib.contextmanager
    def _while_running(self, process: subprocess.Popen) -> Iterator[None]:
        self._running.add(process)
        if self._leaving:  # it began after `__exit__` had looked for it
            _end(process)
        try:
            yield
        finally:
            self._running.discard(process)


def _end(process: subprocess.Popen) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.terminate()  # not SIGINT: a shell makes its background processes ignore it
