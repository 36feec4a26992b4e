"""The parent's side of a stage's process: starts it, passes its events on, and ends it when told to."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gsac.stages.contract import BadInput, StageError

GRACE_S = 2.0
"""A stage that is done has this long to leave."""
LOG_TAIL = 4000


class StageBugError(StageError):
    """A stage raised something it should not have; the log has the traceback."""


def run_child(order: dict[str, Any], log: Path, on_event: Callable[[dict], None]) -> dict[str, Any]:
    """Runs `gsac.pipeline.worker` on the order; its prints go to `log`. Returns the fields of the `done` event.

    BadInput, StageError or StageBugError as the stage failed. Whatever ends the wait (Ctrl-C too) ends the child, and
    all that it started.
    """
    read, write = os.pipe()
    try:
        with log.open("wb") as log_stream:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "gsac.pipeline.worker"],
                stdin=subprocess.PIPE, stdout=log_stream, stderr=subprocess.STDOUT, pass_fds=(write,),
                start_new_session=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
            )
    finally:
        os.close(write)
    end = None
    try:
        with os.fdopen(read) as events:
            with contextlib.suppress(BrokenPipeError):  # died at once: seen below
                process.stdin.write(json.dumps(order | {"events": write, "started": time.time()}).encode() + b"\n")
                process.stdin.flush()
            for line in events:
                event = json.loads(line)
                if event["event"] in ("done", "failed"):
                    end = event
                else:
                    on_event(event)
        if end is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(GRACE_S)  # threads of libraries may keep it from leaving
    finally:
        _end(process)
    return _judge(end, process.returncode, log)


def _judge(end: dict | None, code: int, log: Path) -> dict[str, Any]:
    if end is None:
        why = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        hint = " (out of memory?)" if code == -signal.SIGKILL else ""
        raise StageBugError(f"its process ended without a word: {why}{hint}\n{tail(log)}".rstrip())
    if end["event"] == "failed":
        kind = {"bad input": BadInput, "stage": StageError, "bug": StageBugError}[end["kind"]]
        raise kind(end["message"])
    return end


def _end(process: subprocess.Popen) -> None:
    """The whole group goes at once: what it was writing is private and is dropped."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    with contextlib.suppress(OSError):
        process.stdin.close()


def tail(log: Path) -> str:
    """End of what the stage printed."""
    with contextlib.suppress(OSError):
        with log.open("rb") as stream:
            stream.seek(max(0, log.stat().st_size - LOG_TAIL))
            return stream.read().decode(errors="replace").strip()
    return ""
