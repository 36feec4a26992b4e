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
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

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
LINES_S = 2.0
"""s between two lines of a clip that are passed on."""
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
        self._lines = ray.remote(Lines).options(num_cpus=0).remote()
        self._gpus = ray.cluster_resources().get("GPU", 0)
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
        task = self._ray.remote(run_clip).options(
            num_cpus=min(CORES, self._most_cores()), num_gpus=gpus, max_retries=LOST, retry_exceptions=False,
            memory=int(min(job.peak_mb, self._limits.memory_mb) * 2**20), name=job.name)
        self._tasks[task.remote(part, environment, self._lines)] = (job, part)

    def collect(self) -> Iterator[ClipResult]:
        took: dict[ClipJob, float] = {}
        while self._tasks:
            done, _ = self._ray.wait(list(self._tasks), timeout=LINES_S)
            self._pass_on_lines()
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

    def _pass_on_lines(self) -> None:
        by_out = {str(job.out): job for job, _ in self._tasks.values()}
        with contextlib.suppress(Exception):  # lines are only for people
            for out, line in self._ray.get(self._lines.take.remote(), timeout=LINES_S).items():
                if out in by_out:
                    self._hear(by_out[out], line)

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


class Lines:
    """The last line of each clip at work; an actor."""

    def __init__(self):
        self._lines: dict[str, str] = {}

    def put(self, out: str, line: str) -> None:
        """Notes a line of the clip whose folder is `out`."""
        self._lines[out] = line

    def take(self) -> dict[str, str]:
        """Folder -> line, of clips that have said one since the last call."""
        lines, self._lines = self._lines, {}
        return lines


def run_clip(job: ClipJob, environment: dict[str, str], lines: Any) -> ClipResult:
    """One clip on the machine where this runs."""
    cores = str(CORES)
    own = {name: os.environ[name] for name in MACHINES_OWN if name in os.environ}
    environment = dict.fromkeys(THREADS, cores) | os.environ | environment | own
    last = 0.0

    def hear(line: str) -> None:
        nonlocal last
        if time.monotonic() - last >= LINES_S:
            last = time.monotonic()
            with contextlib.suppress(Exception):
                lines.put.remote(str(job.out), line)

    killed = 0
    while True:
        result = run_process(job, environment, hear)
        killed += result.was_killed
        if not result.was_killed or killed == TRIES:
            return result.set_aside(killed, "on the same machine")
