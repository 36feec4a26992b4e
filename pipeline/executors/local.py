"""A pool of processes on this machine, one a clip: a clip that kills its process harms no other clip.

A clip whose process is killed, as by a machine that ran out of memory, is tried once more, alone; then it is set aside.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, as_completed

from gsac.pipeline.executors.executor import ClipJob, ClipResult, Hear
from gsac.pipeline.executors.memory import Memory
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.tether import tethered

THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Shared out among the clips that run at once, where the user has not set them."""


class LocalExecutor:
    """Runs `gsac run` for each clip. workers: how many clips at once; hear: gets what their runs say; memory_mb: what they may
    take together."""

    def __init__(self, workers: int, hear: Hear, memory_mb: float):
        self._hear, self._memory = hear, Memory(memory_mb)
        self._leaving = False
        self._pool = ThreadPoolExecutor(workers)  # the threads only wait for their process
        self._futures: list[Future[ClipResult]] = []
        self._running: set[subprocess.Popen] = set()
        share = str(max(1, (os.cpu_count() or 1) // workers))
        self._environment = dict.fromkeys(THREADS, share) | os.environ

    def __enter__(self) -> LocalExecutor:
        return self

    def __exit__(self, *exc) -> None:
        self._leaving = True
        self._memory.end()
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in list(self._running):
            with contextlib.suppress(ProcessLookupError):
                process.terminate()  # not SIGINT: a shell makes its background processes ignore it
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
                result = self._try(job)
            killed, wanted = killed + result.was_killed, self._memory.limit_mb
        result.killed = killed
        if killed > 1:
            result.error += " (twice, the second time with no other clip beside it: it is not tried again)"
        return result

    def _try(self, job: ClipJob) -> ClipResult:
        began = time.monotonic()
        with tempfile.TemporaryFile() as out:
            said = []
            with tethered("gsac.pipeline.cli", "run", str(job.clip), "--out", str(job.out), "--json", *job.arguments,
                          stdout=out, stderr=subprocess.PIPE, text=True, errors="replace", env=self._environment) as process:
                assert process.stderr is not None
                self._running.add(process)
                try:
                    with process.stderr as lines:
                        for line in lines:
                            said.append(line.rstrip("\n"))
                            self._hear(job, said[-1])
                    process.wait()
                finally:
                    self._running.discard(process)
            out.seek(0)
            summary = _summary(out.read())
        return ClipResult(job, process.returncode, time.monotonic() - began, _error(process.returncode, said), summary)


def _summary(out: bytes) -> dict:
    lines = out.splitlines()
    with contextlib.suppress(IndexError, ValueError):
        return json.loads(lines[-1])
    return {}


def _error(code: int, words: list[str]) -> str:
    """The sentence with which a run ended."""
    if code == ExitCode.OK:
        return ""
    if code < 0:
        return f"its process was killed by {signal.Signals(-code).name}"
    said = [line for line in words if line.startswith("gsac: ") and not line.startswith("gsac: warning: ")]
    return said[-1].removeprefix("gsac: ") if said else next((line for line in reversed(words) if line.strip()), "no word of why")
