"""The interface of executors: clips are submitted, results collected."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from gsac.pipeline.events import Event
from gsac.pipeline.run_folder import avatar_name


@dataclass(frozen=True)
class ClipJob:
    """One clip of a batch: `gsac run CLIP --out OUT ARGUMENTS`."""

    clip: Path
    out: Path
    arguments: tuple[str, ...] = ()
    peak_mb: float = field(default=0.0, compare=False)
    """Memory that it is reckoned to need."""
    before_gpu: str = field(default="", compare=False)
    """Last of its stages before those that a GPU computes; empty where none has to run."""

    @property
    def name(self) -> str:
        """Its clip's, with its folder's number where clips of a batch have the same."""
        return self.clip.name if self.out.name == avatar_name(self.clip) else f"{self.clip.name} ({self.out.name})"


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
    unchanged: bool = False
    """Whether all its results were in the cache, so that it needed no process."""
    killed: int = 0
    """How often a signal ended its run or a stage of it; after a second time it is not tried again."""

    @property
    def was_killed(self) -> bool:
        """Whether a signal ended its run or a stage of it, as where memory runs out."""
        return self.code < 0 or any(row.get("killed") for row in self.summary.get("stages", []))

    def set_aside(self, killed: int, where: str) -> ClipResult:
        """The same with how often a signal ended it, which is said where it was not once alone. where: its last run was."""
        self.killed = killed
        if killed > 1:
            self.error += f" ({killed} times, the last time {where}: it is not tried again)"
        return self


@dataclass(frozen=True)
class Limits:
    """How much may run at once."""

    workers: int
    """Clips."""
    memory_mb: float
    """Of one machine, that its clips take together."""
    address: str | None = None
    """Of a cluster; None: the one that the environment names, or this machine alone."""


class Hear(Protocol):
    """Called with each event that the run of a clip tells while it is at work, from any thread. attempt: which run of the clip."""

    def __call__(self, job: ClipJob, event: Event, attempt: int = 1) -> None: ...


class Executor(AbstractContextManager, Protocol):
    """Runs clips; leaving the context ends those that still run. Artifacts go through the store, never through the executor."""

    def submit(self, job: ClipJob) -> None:
        """Queues a clip."""

    def collect(self) -> Iterator[ClipResult]:
        """Results as they come, one for each submitted job."""
        ...
