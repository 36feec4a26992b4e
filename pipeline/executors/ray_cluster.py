"""A Ray cluster: a task a clip, on whichever machine has room; its stages for a GPU are a second task. Extra `[ray]`.

Every machine sees clips and output folders under the same paths, and shares results by one cache folder or by GSAC_REMOTE. Only
paths and parameters travel. A clip whose machine is lost starts again on another one, and finds the stages that were finished in
the cache. A clip that kills its process is tried once more; then it is set aside.
"""

from __future__ import annotations

import contextlib
import logging
import os
import socket
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from gsac.pipeline.events import Event, StageLine, StageProgress, read_event
from gsac.pipeline.executors.clip_process import THREADS, run_process
from gsac.pipeline.executors.executor import ClipJob, ClipResult, Hear, Limits
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput

LOST = 3
"""Machines that a clip may lose before it counts as failed."""
TRIES = 2
"""Runs of a clip whose process is killed."""
CORES = 2
"""Of a machine, for each clip; its run shares them out among its threads."""
ANSWER_S = 5.0
"""s in which a cluster's address has to answer."""
PROGRESS_S = 2.0
"""s between two events on a clip's progress that are passed on, and between two looks at what was."""
PASSED_ON = ("GSAC_", "AWS_", "OMP_", "NUMBA_", "OPENBLAS_")
"""Beginnings of environment variables that the clips' runs get from the command."""
MACHINES_OWN = ("GSAC_CACHE", "GSAC_DEVICE")
"""Of those, the ones of which a machine's own counts."""


class RayExecutor:
    """Runs `gsac run` for each clip as a task. Raises BadInput where Ray is missing or no cluster answers."""

    def __init__(self, limits: Limits, hear: Hear):
        try:
            import ray
        except ImportError as error:
            raise BadInput("--executor ray needs Ray: pip install 'gsac[ray]'") from error
        self._ray, self._hear, self._limits = ray, hear, limits
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # a task without a GPU sees what its machine has
        os.environ.setdefault("RAY_raylet_start_wait_time_s", "180")  # a busy machine takes its time
        refuse_deaf(limits.address)
        try:
            ray.init(address=limits.address, logging_level=logging.ERROR, log_to_driver=False, include_dashboard=False)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise BadInput(f"--address {limits.address}: no Ray cluster answers there ({error}); start one with "
                           "`ray start --head`, or leave --address out") from error
        self._events = ray.remote(Events).options(num_cpus=0).remote()
        self._run_clip = ray.remote(run_clip)  # once: each has its code sent to every worker
        self._gpus = ray.cluster_resources().get("GPU", 0)
        self._cores = min(CORES, self._most_cores())
        self._tasks: dict[Any, tuple[ClipJob, ClipJob]] = {}
        """Task -> the clip, and the part of its stages that the task runs."""

    def __enter__(self) -> RayExecutor:
        return self

    def __exit__(self, *exc) -> None:
        for task in self._tasks:
            with contextlib.suppress(Exception):
                self._ray.cancel(task, force=True)
        self._ray.shutdown()

    def submit(self, job: ClipJob) -> None:
        if self._gpus and job.before_gpu:
            self._start(job, replace(job, arguments=(*job.arguments, "--until", job.before_gpu)), 0)
        else:
            self._start(job, job, 0)

    def _start(self, job: ClipJob, part: ClipJob, gpus: int) -> None:
        """Hands the stages of `part` to the cluster, as the next task of the job."""
        environment = {name: value for name, value in os.environ.items() if name.startswith(PASSED_ON)}
        task = self._run_clip.options(
            num_cpus=self._cores, num_gpus=gpus, max_retries=LOST, retry_exceptions=False,
            memory=int(min(job.peak_mb, self._limits.memory_mb) * 2**20), name=job.name)
        self._tasks[task.remote(part, environment, self._events)] = (job, part)

    def collect(self) -> Iterator[ClipResult]:
        took: dict[ClipJob, float] = {}
        while self._tasks:
            done, _ = self._ray.wait(list(self._tasks), timeout=PROGRESS_S)
            self._pass_on_events()
            for task in done:
                job, part = self._tasks.pop(task)
                result = self._result(task, job)
                result.seconds += took.pop(job, 0.0)
                if part.arguments != job.arguments and result.code == ExitCode.OK:
                    took[job] = result.seconds
                    self._start(job, job, 1)
                else:
                    yield replace(result, job=job)

    def _result(self, task: Any, job: ClipJob) -> ClipResult:
        try:
            return self._ray.get(task)
        except self._ray.exceptions.RayError as error:
            why = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            return ClipResult(job, ExitCode.FAILED, 0.0, f"the cluster lost it {LOST + 1} times ({why}); look at the machines, "
                              "then run the batch again", killed=LOST + 1)

    def _pass_on_events(self) -> None:
        by_out = {str(job.out): job for job, _ in self._tasks.values()}
        told = []
        with contextlib.suppress(Exception):  # a machine that is gone takes what it told along; the clip's end comes without
            told = self._ray.get(self._events.take.remote(), timeout=ANSWER_S)
        for out, line, attempt in told:
            event = read_event(line)
            if out in by_out and event is not None:
                self._hear(by_out[out], event, attempt)

    def _most_cores(self) -> float:
        """Cores of the largest machine."""
        return max((node["Resources"].get("CPU", 0) for node in self._ray.nodes() if node["Alive"]), default=1) or 1


def refuse_deaf(address: str | None) -> None:
    """BadInput where nobody listens at a cluster's HOST:PORT, which Ray itself would go on asking for minutes."""
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    if not host or not port.isdecimal():
        return
    try:
        socket.create_connection((host, int(port)), ANSWER_S).close()
    except OSError as error:
        raise BadInput(f"--address {address}: no Ray cluster answers there ({error.strerror or error}); start one with "
                       "`ray start --head`, or leave --address out") from error


class Events:
    """What clips at work have told; an actor."""

    def __init__(self):
        self._told: list[tuple[str, str, int]] = []

    def put(self, out: str, line: str, attempt: int) -> None:
        """Notes an event of the clip whose folder is `out`, as a line, since only the command needs its type."""
        self._told.append((out, line, attempt))

    def take(self) -> list[tuple[str, str, int]]:
        """Folder, line and attempt, of all events since the last call."""
        told, self._told = self._told, []
        return told


def run_clip(job: ClipJob, environment: dict[str, str], events: Any) -> ClipResult:
    """One clip on the machine where this runs."""
    import ray

    cores = str(CORES)
    own = {name: os.environ[name] for name in MACHINES_OWN if name in os.environ}
    environment = dict.fromkeys(THREADS, cores) | os.environ | environment | own
    last, put, killed = 0.0, None, 0

    def hear(event: Event) -> None:
        nonlocal last, put
        seldom = isinstance(event, StageProgress)
        if isinstance(event, StageLine) or (seldom and event.time - last < PROGRESS_S):
            return
        last = event.time if seldom else last
        with contextlib.suppress(Exception):
            put = events.put.remote(str(job.out), event.to_line(), killed + 1)

    while True:
        result = run_process(job, environment, hear)
        killed += result.was_killed
        if not result.was_killed or killed == TRIES:
            if put is not None:
                with contextlib.suppress(Exception):  # events come in order: where the last is there, all are
                    ray.get(put, timeout=ANSWER_S)
            return result.set_aside(killed, "on the same machine")
