import numpy as np
import pytest

from gsac.avatar.logistic import clipped_sigmoid, logit, sigmoid


def test_the_logit_undoes_the_sigmoid():
    x = np.linspace(-9, 9, 31)
    np.testing.assert_allclose(logit(sigmoid(x)), x, atol=1e-9)
    assert sigmoid(0.0) == 0.5


def test_a_networks_logits_of_any_size_overflow_nothing():
    with np.errstate(over="raise"):
        assert clipped_sigmoid(np.float32([-1e30, 0, 1e30])) == pytest.approx([0, 0.5, 1])
