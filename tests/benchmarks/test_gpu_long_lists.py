"""The measurement of long lists replaces text of the kernel: it must still be there."""

from gsac.avatar.cuda.kernels import source
from gsac.benchmarks.gpu import long_lists


def test_what_the_measurement_replaces_is_in_the_kernel_once():
    assert source().count(long_lists.LENGTH) == source().count(long_lists.SORT) == 1
