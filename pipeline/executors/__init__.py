"""Where the clips of a batch run, one file a way: EXECUTORS lists them."""

from __future__ import annotations

from collections.abc import Callable

from gsac.pipeline.executors.executor import Executor
from gsac.stages.contract import BadInput, did_you_mean


def _local(workers: int) -> Executor:
    from gsac.pipeline.executors.local import LocalExecutor

    return LocalExecutor(workers)


EXECUTORS: dict[str, Callable[[int], Executor]] = {"local": _local}


def make_executor(name: str, workers: int) -> Executor:
    """The executor of a name. workers: how many clips at once."""
    if name not in EXECUTORS:
        raise BadInput(f"--executor {name}: unknown{did_you_mean(name, EXECUTORS)}; choices: {', '.join(EXECUTORS)}")
    return EXECUTORS[name](workers)
