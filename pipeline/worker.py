"""The child process of one stage: builds the Job, runs it, checks what it wrote, and sends events to its parent.

Reads two JSON lines from stdin: which modules to load and the file descriptor for events; later, once inputs are there, the order.
Stdin stays open as long as the parent lives; when it closes, the child and its children are killed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import json
import os
import resource
import signal
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from gsac.pipeline.errors import NO_ROOM, sentence
from gsac.pipeline.tether import tether
from gsac.stages.contract import BadInput, Job, Stage, StageError, make_config

if TYPE_CHECKING:
    from gsac.stages.findings import Finding  # it loads numpy

LEAST_GAP_S = 0.1
"""At least this long between two progress events."""


class EventStream:
    """Events for the parent, one JSON object a line."""

    def __init__(self, stream: TextIO):
        self._stream = stream
        self._lock = threading.Lock()
        self._last = 0.0
        self._unit = ""

    def send(self, event: str, **fields: Any) -> None:
        """Writes one event."""
        with self._lock:
            self._stream.write(json.dumps({"event": event, **fields}) + "\n")
            self._stream.flush()

    def resumed(self, done: int, total: int, unit: str) -> None:
        """Sends that the stage goes on from a stopped run's work."""
        self.send("resumed", done=int(done), total=int(total), unit=str(unit))

    def progress(self, done: int, total: int, unit: str) -> None:
        """Sends progress, not too often; the first of a unit and the last always."""
        now = time.monotonic()
        if done >= total or unit != self._unit or now - self._last >= LEAST_GAP_S:
            self._last, self._unit = now, unit
            self.send("progress", done=int(done), total=int(total), unit=str(unit))

    def warn(self, finding: Finding) -> None:
        """Sends a warning for the user."""
        self.send("warning", message=finding.message, finding=finding.to_json())

    def note(self, message: str) -> None:
        """Sends a note for the user."""
        self.send("note", message=str(message))

    def timing(self, name: str, value: Any) -> None:
        """Sends a figure of this run for the cache record. value: as JSON holds it."""
        self.send("timing", name=str(name), value=value)


def main() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    start = json.loads(sys.stdin.readline())
    tether(start["events"])
    os.set_inheritable(start["events"], False)
    events = EventStream(os.fdopen(start["events"], "w"))
    with contextlib.suppress(Exception):  # it fails again, and is reported, once there is an order
        importlib.import_module(start["declaration"])
        entry = importlib.import_module(start["entry"])
        if hasattr(entry, "warm"):
            entry.warm(start["device"])
    line = sys.stdin.readline()
    if not line:
        return
    order = start | json.loads(line)
    try:
        _work(order, events)
    except Exception as error:  # the parent must hear of any failure
        traceback.print_exc()
        events.send("failed", kind=_kind(error), message=_message(error), errno=getattr(error, "errno", None))
    else:
        events.send("done", seconds=time.time() - order["started"], **cost())
    sys.stdout.flush()
    os._exit(0)  # all is written, and libraries take seconds to tear down their threads and memory


def _work(order: dict[str, Any], events: EventStream) -> None:
    stage: Stage = importlib.import_module(order["declaration"]).STAGE
    run = importlib.import_module(order["entry"]).run
    out = Path(order["out"])
    run(Job(
        inputs={port: Path(path) for port, path in order["inputs"].items()},
        out=out,
        scratch=Path(order["scratch"]),
        resumed=events.resumed,
        config=_config(stage, order["params"]),
        models={name: Path(path) for name, path in order["models"].items()},
        device=order["device"],
        progress=events.progress,
        warn=events.warn,
        note=events.note,
        timing=events.timing,
    ))
    check_outputs(stage, out)


def _config(stage: Stage, params: dict[str, Any]) -> Any:
    """The config that the parent sent; StageError where the stage's parameters were edited since."""
    edited = {field.name for field in dataclasses.fields(stage.config)} ^ params.keys()
    if edited:
        raise StageError(f"its parameters were edited since the run began ({', '.join(sorted(edited))}); run again")
    return make_config(stage, params)


def check_outputs(stage: Stage, folder: Path) -> None:
    """StageError unless every declared output was written and passes its check."""
    for output in stage.outputs:
        path = folder / output.path
        if not path.exists():
            raise StageError(f"stage {stage.name} did not write {output.path}")
        try:
            output.check(path)
        except Exception as error:
            raise StageError(f"output {output.path} of stage {stage.name} is not what it should be: {error}") from error


def cost() -> dict[str, float]:
    """CPU seconds and peak memory of this process and the largest of its children."""
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime
    return {"cpu_seconds": cpu, "peak_rss_mb": max(_peak_kb(own.ru_maxrss), children.ru_maxrss) / 1024}


def _peak_kb(fallback: int) -> int:
    """ru_maxrss survives exec and so may be the parent's; Linux's VmHWM does not."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM:")).split()[1])
    except (OSError, StopIteration, ValueError):
        return fallback // (1024 if sys.platform == "darwin" else 1)


def _kind(error: Exception) -> str:
    if isinstance(error, BadInput):
        return "bad input"
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return "no room"
    # An ArtifactError is known by name: toy stages in tests and a user's own need not import gsac.avatar.
    return "stage" if isinstance(error, StageError) or type(error).__name__ == "ArtifactError" else "bug"


def _message(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "out of memory"
    if _kind(error) == "no room":
        return sentence(error)
    return str(error) if _kind(error) != "bug" else f"{type(error).__name__}: {error}"


