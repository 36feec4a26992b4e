"""Different values."""

import numpy as np
import pytest

from gsac.avatar.distinct import distinct


@pytest.mark.parametrize("count", [0, 1, 2, 500])
def test_values_come_once_each_and_in_order(count):
    values = np.random.default_rng(count).integers(-20, 60, count)
    assert distinct(values).tolist() == sorted(set(values.tolist()))
