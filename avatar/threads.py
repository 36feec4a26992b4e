"""Worker threads for numba kernels that release the GIL.

A kernel takes `(worker, workers, ...)` and does every item `worker, worker + workers, ...` or a contiguous share; what it
writes for one item never depends on who does it, so results are bitwise the same for any number of threads.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

_pools: dict[int, ThreadPoolExecutor] = {}
os.register_at_fork(after_in_child=_pools.clear)


def available() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share(threads: int, kernel, *arguments) -> None:
    """Calls `kernel(worker, threads, *arguments)` once for each worker and waits for all."""
    if threads <= 1:
        kernel(0, 1, *arguments)
        return
    pool = _pools.get(threads)
    if pool is None:
        pool = _pools[threads] = ThreadPoolExecutor(threads - 1, thread_name_prefix="kernel")
    others = [pool.submit(kernel, worker, threads, *arguments) for worker in range(1, threads)]
    try:
        kernel(0, threads, *arguments)
    finally:
        for other in others:
            other.result()
