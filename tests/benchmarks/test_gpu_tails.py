"""The measurement of long lists replaces text of the kernel: it must still be there."""

from gsac.avatar.cuda.kernels import source
from gsac.benchmarks.gpu import tails


def test_what_the_measurement_replaces_is_in_the_kernel_once():
    assert source().count(tails.LENGTH) == source().count(tails.SORT) == 1
