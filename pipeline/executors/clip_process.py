"""`gsac run` for one clip in a process of its own: its lines, its end, its --json."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping

from gsac.pipeline.executors.executor import ClipJob, ClipResult
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.tether import tethered

THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Shared out among the clips that run at once, where the user has not set them."""


def run_process(job: ClipJob, environment: Mapping[str, str], hear: Callable[[str], None],
                running: Callable[[subprocess.Popen], contextlib.AbstractContextManager] = contextlib.nullcontext) -> ClipResult:
    """Runs a clip to its end. hear: gets each line as it is said; running: a context for as long as the process is there."""
    began = time.monotonic()
    with tempfile.TemporaryFile() as out:
        said = []
        with tethered("gsac.pipeline.cli", "run", str(job.clip), "--out", str(job.out), "--json", *job.arguments,
                      stdout=out, stderr=subprocess.PIPE, text=True, errors="replace", env=environment) as process:
            assert process.stderr is not None
            with running(process):
                with process.stderr as lines:
                    for line in lines:
                        said.append(line.rstrip("\n"))
                        hear(said[-1])
                process.wait()
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
