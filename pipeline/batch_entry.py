"""What became of one clip of a batch."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from gsac.pipeline.outcomes import ExitCode


class Status(StrEnum):
    """What became of a clip."""

    PLANNED = "planned"
    """Not ended yet."""
    UNCHANGED = "unchanged"
    """All results were in the cache."""
    DONE = "done"
    FAILED = "failed"
    KEPT = "kept"
    """Left as the last batch has left it, since its file is the same."""

    @property
    def is_end(self) -> bool:
        return self is not Status.PLANNED


@dataclass
class Entry:
    """One clip."""

    clip: str
    out: str
    status: Status = Status.PLANNED
    digest: str = ""
    """Of the clip's file or folder when the batch was planned."""
    code: int | None = None
    """Exit code of its run."""
    seconds: float = 0.0
    error: str = ""
    killed: int = 0
    """How often a signal ended its run."""
    metrics: dict[str, Any] = field(default_factory=dict)
    before: dict[str, Any] = field(default_factory=dict)
    """Metrics of the batch before."""

    @classmethod
    def read(cls, raw: Any) -> Entry | None:
        """Of a file's object; None where it is none."""
        try:
            known: dict[str, Any] = {name: raw[name] for name in cls.__dataclass_fields__ if name in raw}
            known["status"] = Status(raw["status"])
            return cls(**known)
        except (TypeError, KeyError, ValueError):
            return None

    def to_json(self) -> dict[str, Any]:
        return self.__dict__ | {"seconds": round(self.seconds, 3)}


def status_of(code: int, unchanged: bool) -> Status:
    """Of a clip whose run has ended. unchanged: whether all results were in the cache."""
    if code != ExitCode.OK:
        return Status.FAILED
    return Status.UNCHANGED if unchanged else Status.DONE
