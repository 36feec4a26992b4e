import threading

import numpy as np
import pytest

from gsac.avatar import threads as workspace
from gsac.avatar.threads import Workspace, side_by_side


@pytest.mark.parametrize("cores", [1, 2, 5])
def test_items_come_back_in_order_each_by_one_thread_with_a_workspace_of_its_own(monkeypatch, cores):
    monkeypatch.setattr(workspace, "available_cores", lambda: cores)
    seen: dict[Workspace, set[int]] = {}

    def work(item: int, own: Workspace) -> float:
        buffer = own.take("numbers", (1000,), np.float64)
        buffer[:] = item
        seen.setdefault(own, set()).add(threading.get_ident())
        assert own.workers == 1
        return float(buffer.sum())

    assert side_by_side(work, iter(range(12))) == [1000.0 * item for item in range(12)]
    assert len(seen) == cores and all(len(threads) == 1 for threads in seen.values())


def test_one_item_has_all_cores_and_none_is_no_trouble(monkeypatch):
    monkeypatch.setattr(workspace, "available_cores", lambda: 3)
    assert side_by_side(lambda item, own: own.workers, [7]) == [3]
    assert side_by_side(lambda item, own: own.workers, []) == []


def test_what_goes_wrong_with_an_item_is_heard(monkeypatch):
    monkeypatch.setattr(workspace, "available_cores", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda item, own: 1 / item, [2, 1, 0])
