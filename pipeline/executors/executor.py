"""The interface of executors: clips are submitted, results collected."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol


@dataclass(frozen=True)
class ClipJob:
    """One clip of a batch: `gsac run CLIP --out OUT ARGUMENTS`."""

    clip: Path
    out: Path
    arguments: tuple[str, ...] = ()


@dataclass
class ClipResult:
    """The end of one clip's run."""

    job: ClipJob
    code: int
    """Exit code of its run."""
    seconds: float
    error: str = ""
    summary: dict[str, Any] = field(default_factory=dict)
    """The object of its --json."""


class Executor(AbstractContextManager, Protocol):
    """Runs clips; leaving the context ends those that still run. Artifacts go through the store, never through the executor."""

    def submit(self, job: ClipJob) -> None:
        """Queues a clip."""

    def collect(self) -> Iterator[ClipResult]:
        """Results as they come, one for each submitted job."""
        ...
