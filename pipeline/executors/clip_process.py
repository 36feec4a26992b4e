"""`gsac run` for one clip in a process of its own: its events, its end, its --json."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping

from gsac.pipeline.events import Event, read_event
from gsac.pipeline.executors.executor import ClipJob, ClipResult
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.tether import tethered
from gsac.pipeline.tracing import UNTRACED

THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Shared out among the clips that run at once, where the user has not set them."""
LAST_WORDS = 1 << 16
"""Bytes of stderr, the last, in which the reason of an end is looked for."""


def run_process(job: ClipJob, environment: Mapping[str, str], hear: Callable[[Event], None],
                running: Callable[[subprocess.Popen], contextlib.AbstractContextManager] = contextlib.nullcontext) -> ClipResult:
    """Runs a clip to its end. hear: gets each event as it is told; running: a context for as long as the process is there."""
    began, last = time.monotonic(), ""
    with tempfile.TemporaryFile() as words:
        with tethered("gsac.pipeline.cli", "run", str(job.clip), "--out", str(job.out), "--json", "--events", "--quiet",
                      *job.arguments, stdout=subprocess.PIPE, stderr=words, text=True, errors="replace",
                      env={**environment, **UNTRACED}) as process:  # the batch traces what it hears
            assert process.stdout is not None
            with running(process):
                with process.stdout as lines:
                    for line in lines:
                        event = read_event(line)
                        if event is not None:
                            hear(event)
                        else:
                            last = line
                process.wait()
        summary = _summary(last)
        words.seek(max(0, words.seek(0, 2) - LAST_WORDS))
        said = words.read().decode(errors="replace").splitlines()
    return ClipResult(job, process.returncode, time.monotonic() - began, _error(process.returncode, summary, said), summary)


def _summary(line: str) -> dict:
    with contextlib.suppress(ValueError):
        found = json.loads(line)
        return found if isinstance(found, dict) else {}
    return {}


def _error(code: int, summary: dict, said: list[str]) -> str:
    """The sentence with which a run ended. said: its lines on stderr, where a run that could not even answer gives its reason."""
    if code == ExitCode.OK:
        return ""
    if code < 0:
        return f"its process was killed by {signal.Signals(-code).name}"
    return summary.get("error") or next((line for line in reversed(said) if line.strip()), "no word of why")
