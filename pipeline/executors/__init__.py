"""Where the clips of a batch run: submit them, collect what became of them. One file a way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from gsac.stages.contract import BadInput


@dataclass(frozen=True)
class ClipJob:
    """One clip of a batch: `gsac run CLIP --out OUT ARGUMENTS`."""

    clip: Path
    out: Path
    arguments: tuple[str, ...] = ()


@dataclass
class ClipResult:
    """What became of it."""

    job: ClipJob
    code: int
    """Exit code of its run."""
    seconds: float
    error: str = ""
    summary: dict[str, Any] = field(default_factory=dict)
    """The object of its --json."""


class Executor(AbstractContextManager, Protocol):
    """Leaving it ends what still runs. Artifacts go through the store, never through the executor."""

    def submit(self, job: ClipJob) -> None: ...

    def collect(self) -> Iterator[ClipResult]:
        """Results as they come, one for each submitted job."""


def _local(workers: int) -> Executor:
    from gsac.pipeline.executors.local import LocalExecutor

    return LocalExecutor(workers)


EXECUTORS: dict[str, Callable[[int], Executor]] = {"local": _local}


def make_executor(name: str, workers: int) -> Executor:
    """workers: how many clips at once."""
    if name not in EXECUTORS:
        raise BadInput(f"--executor {name}: unknown; choices: {', '.join(EXECUTORS)}")
    return EXECUTORS[name](workers)
