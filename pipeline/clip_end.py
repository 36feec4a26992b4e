"""The events with which a clip's run begins and ends; the end is told by the object of its --json."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

from gsac.pipeline.batch_entry import status_of
from gsac.pipeline.errors import ending
from gsac.pipeline.events import ClipEnded, ClipStarted
from gsac.pipeline.journal import Journal
from gsac.pipeline.outcomes import ExitCode, Outcome


@contextlib.contextmanager
def told_clip(journal: Journal, summary: Callable[[], dict[str, Any]]) -> Iterator[None]:
    """Tells that a run begins and, however it ends, that it has ended. summary: of what it has done by now."""
    began = time.monotonic()
    journal.tell(ClipStarted())
    code, error = ExitCode.OK, ""
    try:
        yield
    except BaseException as failure:
        code, error = ending(failure)
        raise
    finally:
        journal.tell(clip_end(code, time.monotonic() - began, error, summary()))


def clip_end(code: int, seconds: float, error: str, summary: dict[str, Any], unchanged: bool | None = None, killed: int = 0,
             clip: str = "") -> ClipEnded:
    """The end of a run. summary: of what it had done; unchanged: whether it needed no process, None: whether nothing of it ran.

    Only figures that are one number or word are told: tables stay in metrics.json.
    """
    rows = summary.get("stages") or []
    figures = {name: value for name, value in (summary.get("metrics") or {}).items()
               if isinstance(value, (str, int, float)) or value is None}
    ran = sum(row["status"] == Outcome.RAN.value for row in rows)
    status = status_of(code, ran == 0 if unchanged is None else unchanged)
    return ClipEnded(clip=clip, status=status.value, code=int(code), seconds=round(seconds, 3), error=error, killed=killed,
                     stages=len(rows), ran=ran, warnings=sum(len(row["warnings"]) for row in rows), metrics=figures)
