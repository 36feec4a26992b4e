"""Threads and buffers of the CPU kernels."""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gsac.avatar import threads
from gsac.avatar.threads import Workspace, side_by_side


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


@pytest.mark.parametrize("cores", [1, 2, 5])
def test_items_come_back_in_order_each_by_one_thread_with_a_workspace_of_its_own(monkeypatch, cores):
    monkeypatch.setattr(threads, "available_cores", lambda: cores)
    seen: dict[Workspace, set[int]] = {}

    def work(item: int, own: Workspace) -> float:
        buffer = own.take("numbers", (1000,), np.float64)
        buffer[:] = item
        seen.setdefault(own, set()).add(threading.get_ident())
        assert own.workers == 1
        return float(buffer.sum())

    assert side_by_side(work, iter(range(12))) == [1000.0 * item for item in range(12)]
    assert 1 <= len(seen) <= cores and all(len(by) == 1 for by in seen.values())


def test_callers_inside_callers_come_to_an_end_however_few_threads_help(monkeypatch):
    monkeypatch.setattr(threads, "available_cores", lambda: 2)
    monkeypatch.setattr(threads, "_pools", {})

    def outer(item: int, own: Workspace) -> list[int]:
        return side_by_side(lambda inner, room: 10 * item + inner, range(3))

    with ThreadPoolExecutor(4) as callers:
        found = list(callers.map(lambda _: side_by_side(outer, range(5)), range(4), timeout=60))
    assert found == [[[10 * item + inner for inner in range(3)] for item in range(5)]] * 4


def test_threads_are_kept_from_call_to_call(monkeypatch):
    monkeypatch.setattr(threads, "available_cores", lambda: 3)
    monkeypatch.setattr(threads, "_pools", {})
    seen: set[threading.Thread] = set()

    def work(item: int, own: Workspace) -> None:
        seen.add(threading.current_thread())
        time.sleep(0.001)

    for _ in range(20):
        side_by_side(work, range(9))
    assert 1 < len(seen) <= 1 + 3


def test_one_item_has_all_cores_and_none_is_no_trouble(monkeypatch):
    monkeypatch.setattr(threads, "available_cores", lambda: 3)
    assert side_by_side(lambda item, own: own.workers, [7]) == [3]
    assert side_by_side(lambda item, own: own.workers, []) == []


def test_what_goes_wrong_with_an_item_is_heard(monkeypatch):
    monkeypatch.setattr(threads, "available_cores", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda item, own: 1 / item, [2, 1, 0])


def test_of_several_items_that_fail_the_first_is_told(monkeypatch):
    monkeypatch.setattr(threads, "available_cores", lambda: 2)
    late = threading.Event()

    def work(item: int, own: Workspace) -> None:
        if item == 1:
            assert late.wait(20)
        if item == 2:
            late.set()
        if item:
            raise ValueError(item)

    with pytest.raises(ValueError, match="1"):
        side_by_side(work, range(6))


@pytest.mark.parametrize("cores", [1, 2, 5])
def test_few_items_are_worked_on_at_the_same_time_each_in_its_own_workspace(monkeypatch, cores):
    monkeypatch.setattr(threads, "available_cores", lambda: cores)
    rooms, both = [Workspace(2), Workspace(2)], threading.Barrier(2)

    def work(item: int, own: Workspace) -> np.ndarray:
        both.wait(timeout=20)
        buffer = own.take("numbers", (5,), np.int64)
        own.share(mark, buffer)
        return buffer * item

    for _ in range(3):
        found = threads.on_each(rooms, work, [1, 10])
        assert [each.tolist() for each in found] == [[1, 2, 1, 2, 1], [10, 20, 10, 20, 10]]
    assert threads.on_each(rooms, lambda item, own: own, [7]) == rooms[:1]
    with pytest.raises(ZeroDivisionError):
        threads.on_each(rooms, lambda item, own: 1 / item, [1, 0])


def test_prefetched_results_come_in_order_and_at_most_so_many_wait():
    started, taken = [], 0
    with ThreadPoolExecutor(2) as pool:
        for result in threads.prefetch(pool, lambda item: started.append(item) or -item, range(9), 3):
            assert result == -taken and len(started) <= taken + 4
            taken += 1
    assert taken == 9
