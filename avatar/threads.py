"""Threads and buffers of the CPU kernels.

A kernel releases the GIL and takes `(worker, workers, ...)`: it does every item `worker, worker + workers, ...`, or its contiguous
share. What it writes for an item never depends on who does it, so results are bitwise the same for any number of threads.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike

Item = TypeVar("Item")
Room = TypeVar("Room")
Result = TypeVar("Result")
Share = Callable[..., None]
"""Type of `Workspace.share`: what it calls takes any arguments."""

MOST_THREADS = 8
"""Threads of one kernel at most: its shares grow too small; a GPU training on 16 cores takes 8.4 s with 8, 9.4 with 16."""
_pools: dict[str, ThreadPoolExecutor] = {}
"""`kernels` do shares of kernels, `callers` call kernels for items of their own: who waits never fills the pool waited for.
`helpers` take turns with who calls them, who needs none of them to come to an end."""
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pools.clear)


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def kernel_threads() -> int:
    """Threads of one kernel where no number is given."""
    return min(MOST_THREADS, available_cores())


class Workspace:
    """Buffers kept from step to step, and the threads that work on them.

    A function's results may lie in its workspace's buffers: they hold until its next call with the same workspace.
    """

    def __init__(self, workers: int | None = None):
        """workers: threads to use; `kernel_threads()` unless given."""
        self.workers = workers or kernel_threads()
        self._buffers: dict[str, np.ndarray] = {}

    def take(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> np.ndarray:
        """An array of that shape (...) with any content; the same memory for the same name."""
        size = math.prod(shape)
        buffer = self._buffers.get(name)
        if buffer is None or buffer.size < size or buffer.dtype != dtype:
            buffer = self._buffers[name] = np.empty(size + size // 8, dtype)
        return buffer[:size].reshape(shape)

    def share(self, kernel: Callable[..., None], *arguments: Any) -> None:
        """Calls `kernel(worker, workers, *arguments)` once for each worker and waits for all."""
        if self.workers <= 1:
            kernel(0, 1, *arguments)
            return
        others = [_pool("kernels").submit(kernel, worker, self.workers, *arguments) for worker in range(1, self.workers)]
        try:
            kernel(0, self.workers, *arguments)
        finally:
            for other in others:
                other.result()


def side_by_side(work: Callable[[Item, Workspace], Result], items: Iterable[Item]) -> list[Result]:
    """[work(item, workspace)] in the order of the items, one item a thread: for images too small to share among threads.

    A result must not lie in its workspace, which the next item uses. Raises what the first item that failed has raised.
    """
    items = list(items)
    many = min(kernel_threads(), len(items))
    if many <= 1:
        workspace = Workspace()
        return [work(item, workspace) for item in items]
    waiting = deque(enumerate(items))
    results: dict[int, Result] = {}
    failed: dict[int, Exception] = {}

    def take_turns() -> None:
        workspace = Workspace(1)
        while waiting and not failed:
            try:
                number, item = waiting.popleft()
            except IndexError:  # another thread took the last one
                return
            try:
                results[number] = work(item, workspace)
            except Exception as error:
                failed[number] = error

    helpers = [_pool("helpers").submit(take_turns) for _ in range(many - 1)]
    try:
        take_turns()
    finally:
        waiting.clear()
        for helper in helpers:
            if not helper.cancel():
                helper.result()
    if failed:
        raise failed[min(failed)]
    return [results[number] for number in range(len(items))]


def on_each(rooms: Sequence[Room], work: Callable[[Item, Room], Result], items: Sequence[Item]) -> list[Result]:
    """[work(item, room)], the items side by side, each in a room of its own, that is its buffers: for few items, step after step.

    A result may lie in its room. items: at most as many as rooms.
    """
    others = [_pool("callers").submit(work, item, room) for item, room in zip(items[1:], rooms[1:], strict=False)]
    try:
        first = work(items[0], rooms[0])
    finally:
        rest = [other.result() for other in others]
    return [first, *rest]


@contextmanager
def opencv_in_one_thread() -> Iterator[None]:
    """OpenCV works in the thread that calls it: images are worked on side by side, and its own threads would spin beside ours."""
    import cv2

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _pool(name: str) -> ThreadPoolExecutor:
    """Its threads start when there is something to do."""
    pool = _pools.get(name)
    if pool is None:
        many = available_cores() if name == "helpers" else kernel_threads()
        pool = _pools[name] = ThreadPoolExecutor(many, thread_name_prefix=name)
    return pool


def prefetch(pool: ThreadPoolExecutor, work: Callable[[Item], Result], items: Iterable[Item], most: int) -> Iterator[Result]:
    """work(item) in the order of the items, computed by the pool while the caller uses earlier results; at most `most` wait."""
    waiting: deque[Future[Result]] = deque()
    for item in items:
        waiting.append(pool.submit(work, item))
        if len(waiting) > most:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()
