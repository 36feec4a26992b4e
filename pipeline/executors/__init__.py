"""Where the clips of a batch run, one file a way: EXECUTORS lists them."""

from __future__ import annotations

from collections.abc import Callable

from gsac.pipeline.executors.executor import Executor, Hear
from gsac.stages.contract import BadInput, did_you_mean


def _local(workers: int, hear: Hear, memory_mb: float) -> Executor:
    from gsac.pipeline.executors.local import LocalExecutor

    return LocalExecutor(workers, hear, memory_mb)


EXECUTORS: dict[str, Callable[[int, Hear, float], Executor]] = {"local": _local}


def check_executor(name: str) -> None:
    """BadInput names the known executors."""
    if name not in EXECUTORS:
        raise BadInput(f"--executor {name}: unknown{did_you_mean(name, EXECUTORS)}; choices: {', '.join(EXECUTORS)}")
