"""Worker processes that run trials: each has its share of the cores, and one that hangs or dies costs its trial only."""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue

from gsac.benchmarks.stability.trial import End, Task, Trial, run_trial

CONTEXT = multiprocessing.get_context("spawn")


class Worker:
    """A process that answers tasks with trials."""

    def __init__(self, cores: list[int]):
        """cores: numbers of those that it may use."""
        self.cores = cores
        self._start()

    def _start(self) -> None:
        self.pipe, other = CONTEXT.Pipe()
        self.process = CONTEXT.Process(target=_serve, args=(other,), daemon=True)
        own = os.sched_getaffinity(0)
        os.sched_setaffinity(0, self.cores)  # the child inherits this thread's; libraries count cores as they load
        self.process.start()
        os.sched_setaffinity(0, own)
        other.close()

    def run(self, task: Task, limit_s: float) -> Trial:
        """The task's trial; one that takes longer than limit_s is killed."""
        try:
            self.pipe.send(task)
            if self.pipe.poll(limit_s):
                return self.pipe.recv()
            end, message = End.HUNG, f"no result after {limit_s:.0f} s"
        except (EOFError, OSError):
            self.process.join()
            end, message = End.CRASHED, f"the process died with exit code {self.process.exitcode}"
        self.close()
        self._start()
        return Trial.of(task, end=end, message=message)

    def close(self) -> None:
        """Ends the process."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def run_all(tasks: list[Task], jobs: int, limit_s: float, tell: Callable[[Trial], None], until_s: float | None = None) -> None:
    """Runs the tasks in their order, `jobs` at a time; tell is called with each trial as it ends.

    limit_s: seconds of one trial; until_s: seconds after which none begins.
    """
    ends = time.monotonic() + (math.inf if until_s is None else until_s)
    cores = sorted(os.sched_getaffinity(0))
    waiting: SimpleQueue[Task] = SimpleQueue()
    for task in tasks:
        waiting.put(task)

    def work(share: list[int]) -> None:
        worker = Worker(share)
        try:
            while time.monotonic() < ends:
                tell(worker.run(waiting.get_nowait(), limit_s))
        except Empty:
            return
        finally:
            worker.close()

    shares = [cores[k * len(cores) // jobs:(k + 1) * len(cores) // jobs] or cores for k in range(jobs)]
    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(work, shares))


def _serve(pipe: Connection) -> None:
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(run_trial(task))
