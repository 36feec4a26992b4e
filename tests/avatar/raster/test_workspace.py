"""Threads and buffers of the kernels."""

from __future__ import annotations

import multiprocessing
import sys

import numpy as np
import pytest

from gsac.avatar.threads import Workspace


def mark(worker, workers, out):
    out[worker::workers] = worker + 1


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_every_worker_does_its_share_once(workers):
    out = np.zeros(23, int)
    Workspace(workers).share(mark, out)
    assert (out == np.arange(23) % workers + 1).all()


def test_an_error_in_any_worker_reaches_the_caller():
    def fail(worker, workers):
        if worker == 1:
            raise RuntimeError("worker 1 failed")

    with pytest.raises(RuntimeError, match="worker 1"):
        Workspace(2).share(fail)


def in_child(results):
    out = np.zeros(4, int)
    Workspace(2).share(mark, out)
    results.put(out.tolist())


@pytest.mark.skipif(sys.platform == "win32", reason="no fork there")
def test_threads_work_in_a_forked_process_after_use_in_its_parent():
    Workspace(2).share(mark, np.zeros(4, int))
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    child = context.Process(target=in_child, args=(results,))
    child.start()
    try:
        assert results.get(timeout=20) == [1, 2, 1, 2]
    finally:
        child.kill()
        child.join()


def test_a_buffer_keeps_its_memory_until_it_must_grow():
    workspace = Workspace(1)
    first = workspace.take("a", (10, 10), np.float32)
    assert np.shares_memory(first, workspace.take("a", (5, 7), np.float32))
    assert not np.shares_memory(first, workspace.take("b", (5, 7), np.float32))
    assert workspace.take("a", (50, 50), np.float32).shape == (50, 50)
    assert workspace.take("a", (3,), np.float64).dtype == np.float64
