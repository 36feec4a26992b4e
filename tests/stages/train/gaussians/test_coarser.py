"""Coarser levels, each there for all who wait for it as soon as it is made."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians.coarser import Coarser


def level(count):
    return Gaussians(*(np.zeros((count, *shape), np.float32) for shape in ((), (3,), (4,), (3,), (3,), ())))


def test_all_who_go_through_levels_have_each_as_soon_as_it_is_made():
    coarser = Coarser()
    one, other = iter(coarser), iter(coarser)
    coarser.add(level(3))
    assert len(next(one)) == 3
    with ThreadPoolExecutor(1) as aside:
        rest = aside.submit(lambda: [len(each) for each in one])
        coarser.add(level(2))
        coarser.end()
        assert rest.result() == [2]
    assert [len(each) for each in other] == [3, 2] and list(Coarser.none()) == []


def test_who_waits_for_a_level_learns_why_there_is_none():
    coarser = Coarser()
    coarser.add(level(3))
    coarser.end(ValueError("no memory"))
    with pytest.raises(ValueError, match="no memory"):
        list(coarser)
