"""The parent's side of a stage's process: starts it, passes its events on, and ends it."""

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

from gsac.cache.half_made import half_made, temporary_folder
from gsac.stages.contract import BadInput, StageError

GRACE_S = 2.0
"""Time for a process that has closed its events to exit by itself, so that its exit code is known."""
LOG_TAIL = 4000
"""Bytes of a log that are shown or kept."""

ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1",
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(1 << 30), "MALLOC_TOP_PAD_": str(32 << 20),
}
"""Of a stage's process, where the user has not set it. Stages spread their frames over threads of their own; a library's threads
for one small matrix or image would only compete with them, more so the more cores there are. And glibc keeps freed memory: to ask
the kernel again for every image costs a tenth of the time of smplx and train."""


class StageBugError(StageError):
    """A stage raised something it should not have; the log has the traceback. killed: name of the signal that ended it."""

    def __init__(self, message: str, killed: str = ""):
        super().__init__(message)
        self.killed = killed


class NoRoomError(StageError):
    """A stage could not write a file; `errno` says what was used up: the disk, a quota, the largest size of a file."""

    def __init__(self, message: str, errno: int):
        super().__init__(message)
        self.errno = errno


class Child:
    """A stage's process. It loads the stage's code at once, then waits for its order; leaving the context kills it."""

    def __init__(self, declaration: str, entry: str, device: str, log: Path):
        """declaration, entry: modules of the stage; device: what it will run on; log: file for its stdout and stderr."""
        self.log = log
        self._kept = contextlib.ExitStack()
        temporary, lock = self._kept.enter_context(half_made(temporary_folder()))
        self._events, write = os.pipe()
        try:
            with log.open("wb") as log_stream:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "gsac.pipeline.by_content"],
                    stdin=subprocess.PIPE, stdout=log_stream, stderr=subprocess.STDOUT, pass_fds=(write, lock),
                    start_new_session=True,
                    env=ENVIRONMENT | os.environ | {"PYTHONUNBUFFERED": "1", "TMPDIR": str(temporary)},
                )
        except BaseException:
            os.close(self._events)
            self._kept.close()
            raise
        finally:
            os.close(write)
        assert self._process.stdin is not None
        self._orders = self._process.stdin
        self._tell({"declaration": declaration, "entry": entry, "device": device, "events": write})

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *exc) -> None:
        self.close()

    def close(self) -> None:
        """Kills the process group and removes its temporary files; what it was writing is private and is dropped."""
        events, self._events = self._events, -1
        if events >= 0:
            os.close(events)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        with contextlib.suppress(OSError):
            self._orders.close()
        self._kept.close()

    def order(self, order: dict[str, Any]) -> None:
        """Gives it its one order."""
        self._tell(order | {"started": time.time()})

    def follow(self, on_event: Callable[[dict], None]) -> dict[str, Any]:
        """Waits until the order is done. Returns the fields of the `done` event; raises BadInput, StageError or StageBugError as
        the stage failed."""
        # Given up before it is opened: what is interrupted in between would be closed twice.
        end, number, self._events = None, self._events, -1
        with os.fdopen(number) as events:
            for line in events:
                event = json.loads(line)
                if event["event"] in ("done", "failed"):
                    end = event
                    break
                on_event(event)
        if end is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE_S)
            self.close()
        return _judge(end, self._process.returncode, self.log)

    def rename_log(self, log: Path) -> None:
        """Moves the log file, which the process goes on writing to."""
        self.log = self.log.replace(log)

    def _tell(self, words: dict[str, Any]) -> None:
        with contextlib.suppress(BrokenPipeError):  # died at once: `follow` sees it
            self._orders.write(json.dumps(words).encode() + b"\n")
            self._orders.flush()


def _judge(end: dict | None, code: int, log: Path) -> dict[str, Any]:
    if end is None:
        killed = signal.Signals(-code).name if code < 0 else ""
        why = f"killed by {killed}" if killed else f"exit code {code}"
        hint = " (out of memory?)" if code == -signal.SIGKILL else ""
        raise StageBugError(f"its process ended without a word: {why}{hint}\n{tail(log)}".rstrip(), killed)
    if end["event"] == "failed" and end["kind"] == "no room":
        raise NoRoomError(end["message"], end["errno"])
    if end["event"] == "failed":
        kind = {"bad input": BadInput, "stage": StageError, "bug": StageBugError}[end["kind"]]
        raise kind(end["message"])
    return end


class LogReader:
    """Reads a log file while it grows."""

    def __init__(self, log: Path):
        self._log = log
        self._position = 0

    def new_lines(self, ended: bool = False) -> list[str]:
        """Lines that were not returned before; one without its end only where the writer has ended."""
        with contextlib.suppress(OSError), self._log.open("rb") as stream:
            stream.seek(self._position)
            text = stream.read()
            text = text if ended else text[:text.rfind(b"\n") + 1]
            self._position += len(text)
            return text.decode(errors="replace").splitlines()
        return []


def tail(log: Path) -> str:
    """The last lines that the stage printed."""
    with contextlib.suppress(OSError), log.open("rb") as stream:
        stream.seek(max(0, log.stat().st_size - LOG_TAIL))
        return stream.read().decode(errors="replace").strip()
    return ""
