"""Where the clips of a batch run, one file a way: EXECUTORS lists them."""

from __future__ import annotations

from collections.abc import Callable

from gsac.pipeline.executors.executor import Executor, Hear, Limits
from gsac.stages.contract import BadInput, did_you_mean


def _local(limits: Limits, hear: Hear) -> Executor:
    from gsac.pipeline.executors.local import LocalExecutor

    return LocalExecutor(limits, hear)


def _ray(limits: Limits, hear: Hear) -> Executor:
    from gsac.pipeline.executors.ray_cluster import RayExecutor

    return RayExecutor(limits, hear)


EXECUTORS: dict[str, Callable[[Limits, Hear], Executor]] = {"local": _local, "ray": _ray}


def check_executor(name: str) -> None:
    """BadInput names the known executors."""
    if name not in EXECUTORS:
        raise BadInput(f"--executor {name}: unknown{did_you_mean(name, EXECUTORS)}; choices: {', '.join(EXECUTORS)}")
